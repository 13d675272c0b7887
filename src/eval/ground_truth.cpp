#include "doppel/eval/ground_truth.h"

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"

namespace doppel {

torch::Tensor read_surfaces(const std::filesystem::path& path, std::int64_t num_vertices) {
  const NpyArray array = read_npy(path);
  if (array.shape.size() != 3 || array.shape[1] != num_vertices || array.shape[2] != 3)
    fail("{}: expected [frames,{},3] for this character, found [{}]", path.string(), num_vertices,
         fmt::join(array.shape, ","));
  const std::vector<float> values = array.as<float>();
  return torch::tensor(values).view({array.shape[0], num_vertices, 3});
}

GroundTruth::GroundTruth(const Dataset& dataset) {
  for (const DatasetSequence& sequence : dataset.sequences()) {
    const auto path = dataset.capture().resolve("ground_truth/" + sequence.name + "/vertices.npy");
    paths_.push_back(std::filesystem::exists(path) ? path : std::filesystem::path());
  }
  vertices_.resize(paths_.size());
}

torch::Tensor GroundTruth::at(const SampleId& sample, std::int64_t num_vertices) {
  const auto index = as_size(sample.sequence);
  if (paths_[index].empty()) return {};
  torch::Tensor& all = vertices_[index];
  if (!all.defined()) all = read_surfaces(paths_[index], num_vertices);
  if (sample.frame >= all.size(0))
    fail("{} holds {} frames; frame {} is missing", paths_[index].string(), all.size(0), sample.frame);
  return all[sample.frame];
}

}  // namespace doppel
