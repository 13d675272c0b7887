#include "doppel/eval/ground_truth.h"

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

void check_shape(const std::filesystem::path& path, const std::vector<std::int64_t>& shape, std::int64_t num_vertices) {
  if (shape.size() != 3 || shape[1] != num_vertices || shape[2] != 3)
    fail("{}: expected [frames,{},3] for this character, found [{}]", path.string(), num_vertices,
         fmt::join(shape, ","));
}

}  // namespace

torch::Tensor read_surfaces(const std::filesystem::path& path, std::int64_t num_vertices) {
  const NpyArray array = read_npy(path);
  check_shape(path, array.shape, num_vertices);
  const std::vector<float> values = array.as<float>();
  return torch::tensor(values).view({array.shape[0], num_vertices, 3});
}

GroundTruth::GroundTruth(const Dataset& dataset) {
  for (const DatasetSequence& sequence : dataset.sequences()) {
    const auto path = dataset.capture().resolve("ground_truth/" + sequence.name + "/vertices.npy");
    paths_.push_back(std::filesystem::exists(path) ? path : std::filesystem::path());
  }
  surfaces_.resize(paths_.size());
}

torch::Tensor GroundTruth::at(const SampleId& sample, std::int64_t num_vertices) {
  const auto index = as_size(sample.sequence);
  if (paths_[index].empty()) return {};
  std::optional<NpyItems>& surfaces = surfaces_[index];
  if (!surfaces) {
    surfaces.emplace(paths_[index]);
    check_shape(paths_[index], surfaces->shape(), num_vertices);
  }
  if (sample.frame >= surfaces->size())
    fail("{} holds {} frames; frame {} is missing", paths_[index].string(), surfaces->size(), sample.frame);
  return torch::tensor(surfaces->read(sample.frame)).view({num_vertices, 3});
}

}  // namespace doppel
