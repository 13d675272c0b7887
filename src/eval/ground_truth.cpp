#include "doppel/eval/ground_truth.h"

#include <algorithm>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

void check_shape(const std::filesystem::path& path, const std::vector<std::int64_t>& shape, std::int64_t num_vertices) {
  if (shape.size() != 3 || shape[1] != num_vertices || shape[2] != 3)
    fail("{}: expected [frames,{},3] for this character, found [{}]", path.string(), num_vertices,
         fmt::join(shape, ","));
}

/// The file of a sequence, whether or not it is there.
std::filesystem::path ground_truth_file(const Dataset& dataset, const DatasetSequence& sequence) {
  return dataset.capture().resolve("ground_truth/" + sequence.name + "/vertices.npy");
}

}  // namespace

torch::Tensor read_surfaces(const std::filesystem::path& path, std::int64_t num_vertices) {
  const NpyArray array = read_npy(path);
  check_shape(path, array.shape, num_vertices);
  const std::vector<float> values = array.as<float>();
  return torch::tensor(values).view({array.shape[0], num_vertices, 3});
}

std::string ground_truth_of_another_character(const Dataset& dataset, const std::vector<Split>& splits,
                                              std::int64_t num_vertices) {
  for (const DatasetSequence& sequence : dataset.sequences()) {
    const std::filesystem::path path = ground_truth_file(dataset, sequence);
    if (std::find(splits.begin(), splits.end(), sequence.split) == splits.end() || !std::filesystem::exists(path))
      continue;
    const std::vector<std::int64_t> shape = NpyItems(path).shape();
    if (shape.size() == 3 && shape[1] != num_vertices)
      return fmt::format("{} has surfaces of {} vertices, the character has {}", path.string(), shape[1], num_vertices);
  }
  return "";
}

GroundTruth::GroundTruth(const Dataset& dataset, bool wanted) {
  for (const DatasetSequence& sequence : dataset.sequences()) {
    const std::filesystem::path path = ground_truth_file(dataset, sequence);
    paths_.push_back(wanted && std::filesystem::exists(path) ? path : std::filesystem::path());
  }
  surfaces_.resize(paths_.size());
}

bool GroundTruth::has(const SampleId& sample) const { return !paths_[as_size(sample.sequence)].empty(); }

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
