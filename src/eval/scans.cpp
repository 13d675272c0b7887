#include "doppel/eval/scans.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <string>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/lower_case.h"
#include "doppel/eval/surface_metrics.h"
#include "doppel/geometry/mesh.h"
#include "doppel/render/mesh/face_tensor.h"

namespace doppel {

namespace {

constexpr std::size_t kMaxFrameDigits = 18;  // more do not fit into a number

/// Whether the name of a file, without its extension, is a frame number.
bool is_frame_number(const std::string& stem) {
  return !stem.empty() && stem.size() <= kMaxFrameDigits &&
         std::all_of(stem.begin(), stem.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

/// The scans of one folder by frame, and how many meshes there have a format that is not read.
struct ScanFolder {
  std::map<long, std::filesystem::path> files;
  int unread = 0;

  explicit ScanFolder(const std::filesystem::path& folder) {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      const std::filesystem::path& path = entry.path();
      if (!entry.is_regular_file() || !is_frame_number(path.stem().string())) continue;
      const std::string kind = lower_case(path.extension().string());
      if (kind == ".ply") ++unread;
      if (kind != ".obj") continue;
      const auto [found, added] = files.emplace(std::stol(path.stem().string()), path);
      if (!added)
        fail<UsageError>("scans: {} and {} are scans of one frame; remove one of them", found->second.string(),
                         path.string());
    }
  }
};

torch::Tensor scan_vertices(const TriangleMesh& mesh) {
  torch::Tensor vertices = torch::empty({mesh.num_vertices(), 3}, torch::kFloat32);
  float* out = vertices.data_ptr<float>();
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    for (int k = 0; k < 3; ++k) *out++ = static_cast<float>(vertex[k]);
  return vertices;
}

}  // namespace

Scans::Scans(const Dataset& dataset, const std::vector<SampleId>& samples, const std::filesystem::path& folder,
             double metres_per_unit)
    : metres_per_unit_(metres_per_unit) {
  if (!std::filesystem::is_directory(folder)) fail<UsageError>("scans: the folder {} does not exist", folder.string());
  std::map<std::filesystem::path, ScanFolder> folders;
  std::set<std::string> without_folder;
  int unread = 0;
  for (const SampleId& sample : samples) {
    const std::string& sequence = dataset.sequences().at(as_size(sample.sequence)).name;
    const bool own = std::filesystem::is_directory(folder / sequence);
    const std::filesystem::path source = own ? folder / sequence : folder;
    const auto [listed, is_new] = folders.try_emplace(source, source);
    if (is_new) unread += listed->second.unread;
    const auto scan = listed->second.files.find(sample.frame);
    if (scan == listed->second.files.end()) continue;
    files_[{sample.sequence, sample.frame}] = scan->second;
    if (!own) without_folder.insert(sequence);
  }
  if (without_folder.size() > 1)
    fail<UsageError>(
        "scans: {} holds scans without naming their sequence, but {} sequences are evaluated; put the "
        "scans of each into {}/<sequence>/",
        folder.string(), without_folder.size(), folder.string());
  if (!files_.empty()) return;
  const std::string first = samples.empty() ? "" : dataset.sequences()[samples.front().sequence].name;
  fail<UsageError>(
      "scans: none of the {} evaluated frames has one; looked for {}/<sequence>/<frame>.obj (such as "
      "{}/{}/{}.obj) and {}/<frame>.obj, where <frame> is the row of the motion{}",
      samples.size(), folder.string(), folder.string(), first, samples.empty() ? 0 : samples.front().frame,
      folder.string(), unread > 0 ? "; .ply files are not read, convert them to .obj" : "");
}

std::optional<double> Scans::mean_distance(const SampleId& sample, const torch::Tensor& vertices) const {
  const auto file = files_.find({sample.sequence, sample.frame});
  if (file == files_.end()) return std::nullopt;
  const TriangleMesh scan = read_obj(file->second, metres_per_unit_);
  return SurfaceDistance(scan_vertices(scan), face_tensor(scan)).distances(vertices).mean().item<double>();
}

}  // namespace doppel
