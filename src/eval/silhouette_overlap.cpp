#include "doppel/eval/silhouette_overlap.h"

#include <ATen/Parallel.h>

#include <algorithm>
#include <map>

#include "doppel/character/character.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/progress.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/eval/evaluation_columns.h"
#include "doppel/eval/ground_truth.h"
#include "doppel/eval/hand_boxes.h"
#include "doppel/eval/mean.h"
#include "doppel/eval/scans.h"
#include "doppel/eval/surface_metrics.h"
#include "doppel/eval/surface_shape.h"
#include "doppel/layers/surface.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/outline/seen_vertices.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"

namespace doppel {

namespace {

/// Frames drawn at once; bounds the memory for coverage images.
constexpr std::size_t kFramesAtOnce = 8;

/// Cameras with images of the same size, which are drawn together.
struct CameraGroup {
  int width, height;
  std::vector<int> cameras;
  torch::Tensor projection;  ///< [C,3,4]
};

std::vector<CameraGroup> group_by_size(const Dataset& dataset, const std::vector<int>& indices) {
  std::map<std::pair<int, int>, CameraGroup> groups;
  for (int index : indices) {
    const PinholeCamera& camera = dataset.camera(index);
    CameraGroup& group =
        groups.try_emplace({camera.width, camera.height}, CameraGroup{camera.width, camera.height, {}, {}})
            .first->second;
    group.cameras.push_back(index);
  }
  std::vector<CameraGroup> out;
  for (auto& [size, group] : groups) {
    std::vector<PinholeCamera> cameras;
    for (int index : group.cameras) cameras.push_back(dataset.camera(index));
    group.projection = projection_tensor(cameras);
    out.push_back(std::move(group));
  }
  return out;
}

/// The overlap of a view, and of the squares around the hands in it.
struct ViewOverlap {
  Overlap whole;
  std::vector<Overlap> hands;
};

Overlap overlap_in(const cv::Rect& box, const cv::Mat& mask, const std::uint8_t* covered) {
  Overlap result;
  for (int y = box.y; y < box.y + box.height; ++y)
    result += overlap(mask.ptr(y) + box.x, covered + std::int64_t{y} * mask.cols + box.x, box.width);
  return result;
}

/// Overlaps of B frames with the cameras of a group, [B][C].
/// @param hands null: not measured
std::vector<std::vector<ViewOverlap>> overlaps(const Dataset& dataset, const CameraGroup& group, Rasterizer& rasterizer,
                                               const std::vector<SampleId>& samples, const torch::Tensor& vertices,
                                               const HandBoxes* hands) {
  const auto num_frames = static_cast<std::int64_t>(samples.size()),
             num_cameras = static_cast<std::int64_t>(group.cameras.size());
  const torch::Tensor covered =
      rasterizer
          .coverage_projected(vertices, group.projection.expand({num_frames, num_cameras, 3, 4}).contiguous(),
                              group.height, group.width)
          .contiguous();
  const std::uint8_t* pixels = covered.data_ptr<std::uint8_t>();
  const std::int64_t image = std::int64_t{group.width} * group.height;
  std::vector<std::vector<ViewOverlap>> result(samples.size(), std::vector<ViewOverlap>(group.cameras.size()));
  at::parallel_for(0, num_frames * num_cameras, 1, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) {
      const std::int64_t b = i / num_cameras, c = i % num_cameras;
      const cv::Mat mask = dataset.mask(samples[b], group.cameras[c]);
      if (mask.cols != group.width || mask.rows != group.height)
        fail("camera {}: the mask of frame {} is {}x{}, the camera {}x{}", dataset.camera(group.cameras[c]).name,
             samples[b].frame, mask.cols, mask.rows, group.width, group.height);
      const cv::Mat whole = mask.isContinuous() ? mask : mask.clone();
      result[b][c].whole = overlap(whole.data, pixels + i * image, image);
      if (!hands) continue;
      for (const cv::Rect& box : hands->find(samples[b], group.cameras[c]))
        result[b][c].hands.push_back(overlap_in(box, whole, pixels + i * image));
    }
  });
  return result;
}

/// The overlaps of an evaluation.
struct OverlapMeans {
  std::map<int, Mean> cameras;  ///< IoU by camera, over frames
  Mean hands;                   ///< IoU of the squares around hands
  Overlap total;

  /// @param frames [B][C]
  void add(const CameraGroup& group, const std::vector<std::vector<ViewOverlap>>& frames) {
    for (const auto& frame : frames)
      for (std::size_t c = 0; c < group.cameras.size(); ++c) {
        if (const auto iou = frame[c].whole.iou()) cameras[group.cameras[c]].add(*iou);
        total += frame[c].whole;
        for (const Overlap& hand : frame[c].hands)
          if (const auto iou = hand.iou()) hands.add(*iou);
      }
  }
  /// @pre some camera saw something
  void write(SurfaceResult& result) const {
    const auto united = static_cast<double>(total.united);
    result.outside = static_cast<double>(total.only_b) / united;
    result.missing = static_cast<double>(total.united - total.intersection - total.only_b) / united;
    if (hands.count > 0) result.hand_IoU = hands.value();
  }
};

/// Which vertices of a surface the cameras of a capture see. @param vertices [N,3] @return bool [N]
torch::Tensor seen_by_cameras(const Dataset& dataset, Rasterizer& rasterizer, const torch::Tensor& vertices,
                              const torch::Tensor& faces) {
  const torch::Tensor corners = faces.to(torch::kInt64);
  torch::Tensor seen = torch::zeros({vertices.size(0)}, torch::kBool);
  for (int index : dataset.camera_indices({})) {
    const PinholeCamera& camera = dataset.camera(index);
    const torch::Tensor projection = projection_tensor({camera}).contiguous();
    const RasterImage& image =
        rasterizer.rasterize_projected(vertices.unsqueeze(0), projection.unsqueeze(0), camera.height, camera.width);
    seen |= seen_vertices(image.face_id[0], corners, vertices, camera_placement(projection[0]).centre);
  }
  return seen;
}

/// Errors over frames of surfaces against the true surfaces, metres.
class GroundTruthErrors {
 public:
  /// @param skinned as in evaluate_surface
  GroundTruthErrors(const Dataset& dataset, const Character& character, const torch::Tensor& faces,
                    const SurfaceFunction& skinned, const EvaluationOptions& options)
      : dataset_(dataset),
        faces_(faces),
        skinned_(skinned),
        template_(character),
        ground_truth_(dataset, options.ground_truth),
        shape_(SurfaceShape(faces, character.num_vertices(), character.labels)) {}

  /// Adds a frame, if its true surface is known. @param vertices [N,3]
  void add(const SampleId& sample, const torch::Tensor& vertices, Rasterizer& rasterizer) {
    const torch::Tensor expected = ground_truth_.at(sample, vertices.size(0));
    if (!expected.defined()) return;
    vertex_.add((vertices - expected).norm(2, 1).mean().item<double>());
    const SurfaceGap gap = surface_gap(vertices, faces_, expected, faces_);
    hausdorff_.add(gap.hausdorff);
    surface_.add(gap.mean);
    const torch::Tensor seen = seen_by_cameras(dataset_, rasterizer, expected, faces_);
    if (seen.any().item<bool>()) seen_surface_.add(gap.from_a.masked_select(seen).mean().item<double>());
    shape_.add(vertices, expected);
    if (!dataset_.sequences()[as_size(sample.sequence)].has_motion()) return;
    const torch::Tensor in_true_pose = template_->skinned(dataset_.dof_windows({sample}, 0).squeeze(1))[0];
    shape_.add_displacements(vertices - (skinned_ ? skinned_({sample})[0] : in_true_pose), expected - in_true_pose);
  }
  void write(SurfaceResult& result) const {
    if (vertex_.count == 0) return;
    result.vertex_error_mm = 1000.0 * vertex_.value();
    result.Hausdorff_mm = 1000.0 * hausdorff_.value();
    result.surface_distance_mm = 1000.0 * surface_.value();
    if (seen_surface_.count > 0) result.seen_distance_mm = 1000.0 * seen_surface_.value();
    result.normal_error_deg = shape_.normal_error();
    result.roughness_error_mm = 1000.0 * shape_.roughness_error().value();
    result.roughness_ratio = shape_.roughness_ratio();
    result.border_length_ratio = shape_.border_length_ratio();
  }

 private:
  const Dataset& dataset_;
  const torch::Tensor faces_;
  const SurfaceFunction& skinned_;
  CharacterSurface template_;
  GroundTruth ground_truth_;
  ShapeErrors shape_;
  Mean vertex_, hausdorff_, surface_, seen_surface_;
};

/// Mean distances over frames between a surface and the scans of an evaluation, metres.
class ScanErrors {
 public:
  ScanErrors(const Dataset& dataset, const std::vector<SampleId>& samples, const EvaluationOptions& options) {
    if (!options.scans.empty()) scans_.emplace(dataset, samples, options.scans, options.scan_unit);
  }
  /// @param vertices [N,3]
  void add(const SampleId& sample, const torch::Tensor& vertices) {
    if (!scans_) return;
    if (const auto distance = scans_->mean_distance(sample, vertices)) frames_.add(*distance);
  }
  void write(SurfaceResult& result) const {
    if (frames_.count > 0) result.scan_distance_mm = 1000.0 * frames_.value();
  }

 private:
  std::optional<Scans> scans_;
  Mean frames_;
};

/// The splits that have frames, as in a sentence.
std::string split_list(const Dataset& dataset) {
  std::vector<std::string> words;
  for (const Split split : {Split::train, Split::validation, Split::test})
    if (!dataset.samples(split).empty()) words.push_back(to_string(split));
  return fmt::format("{}", fmt::join(words, ", "));
}

/// @throws UsageError when no sequence has the split
void require_split(const Dataset& dataset, Split split) {
  if (dataset.samples(split).empty())
    fail<UsageError>("--split {}: {} has no sequence with this split; it has {}", to_string(split),
                     dataset.folder().string(), split_list(dataset));
}

/// @throws UsageError for a frame that no sequence of these splits has
void require_frames(const Dataset& dataset, const std::vector<Split>& splits, const std::vector<long>& frames) {
  std::vector<SampleId> all;
  std::vector<std::string> words;
  for (const Split split : splits) {
    const std::vector<SampleId> samples = dataset.samples(split);
    all.insert(all.end(), samples.begin(), samples.end());
    words.push_back(to_string(split));
  }
  for (const long frame : frames) {
    if (std::any_of(all.begin(), all.end(), [&](const SampleId& sample) { return sample.frame == frame; })) continue;
    const DatasetSequence& first = dataset.sequences().at(as_size(all.at(0).sequence));
    fail<UsageError>("--frames: no sequence of the split {} has a frame {}; {} has {} to {}", fmt::join(words, ", "),
                     frame, first.name, first.first_frame, first.last_frame);
  }
}

/// The conditions of the distances to scans.
nlohmann::ordered_json scan_protocol(const Dataset& dataset, const std::vector<Split>& splits,
                                     const EvaluationOptions& options) {
  nlohmann::ordered_json json;
  json["metric"] =
      "mean distance of all vertices of the surface to the scan, one direction; mean over frames with a scan";
  json["folder"] = std::filesystem::absolute(options.scans).lexically_normal().string();
  json["metres_per_unit"] = options.scan_unit;
  for (Split split : splits)
    json["frames"][to_string(split)] =
        Scans(dataset, evaluated_samples(dataset, split, options), options.scans, options.scan_unit).size();
  return json;
}

/// SVIoU and RVIoU: the input camera against all others.
void split_by_input(SurfaceResult& result, const std::string& input_camera) {
  Mean others;
  for (const auto& [name, iou] : result.cameras) {
    if (name == input_camera)
      result.SVIoU = iou;
    else
      others.add(iou);
  }
  if (others.count > 0) result.RVIoU = others.value();
}

}  // namespace

Overlap overlap(const std::uint8_t* a, const std::uint8_t* b, std::int64_t count) {
  Overlap result;
  for (std::int64_t i = 0; i < count; ++i) {
    const bool in_a = a[i] != 0, in_b = b[i] != 0;
    result.intersection += in_a && in_b;
    result.united += in_a || in_b;
    result.only_b += in_b && !in_a;
  }
  return result;
}

nlohmann::ordered_json SurfaceResult::to_json() const {
  nlohmann::ordered_json json;
  json["AMVIoU"] = AMVIoU;
  if (RVIoU) json["RVIoU"] = *RVIoU;
  if (SVIoU) json["SVIoU"] = *SVIoU;
  if (hand_IoU) json["hand_IoU"] = *hand_IoU;
  if (vertex_error_mm) json["vertex_error_mm"] = *vertex_error_mm;
  if (Hausdorff_mm) json["Hausdorff_mm"] = *Hausdorff_mm;
  if (surface_distance_mm) json["surface_distance_mm"] = *surface_distance_mm;
  if (seen_distance_mm) json["seen_distance_mm"] = *seen_distance_mm;
  if (normal_error_deg) json["normal_error_deg"] = *normal_error_deg;
  if (roughness_error_mm) json["roughness_error_mm"] = *roughness_error_mm;
  if (roughness_ratio) json["roughness_ratio"] = *roughness_ratio;
  if (border_length_ratio) json["border_length_ratio"] = *border_length_ratio;
  if (scan_distance_mm) json["scan_distance_mm"] = *scan_distance_mm;
  json["outside"] = outside;
  json["missing"] = missing;
  for (const auto& [name, iou] : cameras) json["cameras"][name] = iou;
  return json;
}

std::vector<SampleId> evaluated_samples(const Dataset& dataset, Split split, const EvaluationOptions& options) {
  require_split(dataset, split);
  if (options.frames.empty()) return dataset.samples(split, options.every);
  std::vector<SampleId> chosen;
  for (const SampleId& sample : dataset.samples(split))
    if (std::find(options.frames.begin(), options.frames.end(), sample.frame) != options.frames.end())
      chosen.push_back(sample);
  if (chosen.empty()) require_frames(dataset, {split}, options.frames);
  return chosen;
}

SurfaceResult evaluate_surface(const Dataset& dataset, Split split, const Character& character,
                               const SurfaceFunction& surface, const EvaluationOptions& options,
                               const std::string& title, const SurfaceFunction& skinned) {
  torch::NoGradGuard no_grad;
  const std::vector<int> cameras = dataset.camera_indices(options.cameras);
  if (!options.input_camera.empty()) {
    const int input = dataset.camera_index(options.input_camera);
    if (std::find(cameras.begin(), cameras.end(), input) == cameras.end())
      fail<UsageError>("the input camera {} is not among the compared cameras", options.input_camera);
  }
  const std::vector<CameraGroup> groups = group_by_size(dataset, cameras);
  const std::vector<SampleId> samples = evaluated_samples(dataset, split, options);
  const torch::Tensor faces = face_tensor(character.mesh);
  Rasterizer rasterizer(faces);
  const HandBoxes hands(dataset, character.skeleton);
  OverlapMeans means;
  GroundTruthErrors errors(dataset, character, faces, skinned, options);
  ScanErrors scan_errors(dataset, samples, options);
  Progress progress(title, static_cast<std::int64_t>(samples.size()));
  for (std::size_t first = 0; first < samples.size(); first += kFramesAtOnce) {
    const std::size_t last = std::min(first + kFramesAtOnce, samples.size());
    const std::vector<SampleId> part(samples.begin() + static_cast<std::ptrdiff_t>(first),
                                     samples.begin() + static_cast<std::ptrdiff_t>(last));
    const torch::Tensor vertices = surface(part).to(torch::kFloat32).contiguous();
    for (const CameraGroup& group : groups)
      means.add(group, overlaps(dataset, group, rasterizer, part, vertices, hands.known() ? &hands : nullptr));
    for (std::size_t b = 0; b < part.size(); ++b) {
      const torch::Tensor found = vertices[static_cast<std::int64_t>(b)];
      errors.add(part[b], found, rasterizer);
      scan_errors.add(part[b], found);
    }
    progress.advance(static_cast<std::int64_t>(part.size()));
  }
  SurfaceResult result;
  for (int camera : cameras)
    if (const auto mean = means.cameras.find(camera); mean != means.cameras.end())
      result.cameras.emplace_back(dataset.camera(camera).name, mean->second.value());
  if (result.cameras.empty()) fail("nothing to evaluate in the {} split: no frame shows the person", to_string(split));
  for (const auto& [name, iou] : result.cameras) result.AMVIoU += iou / static_cast<double>(result.cameras.size());
  if (!options.input_camera.empty()) split_by_input(result, options.input_camera);
  means.write(result);
  errors.write(result);
  scan_errors.write(result);
  return result;
}

nlohmann::ordered_json evaluation_protocol(const Dataset& dataset, const std::vector<Split>& splits,
                                           const EvaluationOptions& options) {
  for (const Split split : splits) require_split(dataset, split);
  require_frames(dataset, splits, options.frames);
  nlohmann::ordered_json json;
  json["metric"] =
      "AMVIoU: IoU of the drawn surface and the mask at full resolution, mean over frames, then over cameras";
  json["capture"] = dataset.capture().name;
  json["every"] = options.every;
  if (!options.frames.empty()) json["only_frames"] = options.frames;
  for (Split split : splits) json["frames"][to_string(split)] = evaluated_samples(dataset, split, options).size();
  for (int index : dataset.camera_indices(options.cameras)) {
    const PinholeCamera& camera = dataset.camera(index);
    json["cameras"].push_back(camera.name);
    json["resolution"][camera.name] = {camera.width, camera.height};
  }
  for (const SequenceEntry& entry : dataset.capture().sequences)
    json["mask_threshold"][entry.name] =
        entry.masks_from_images() ? nlohmann::ordered_json(entry.chroma_key ? "chroma key" : "background subtraction")
                                  : nlohmann::ordered_json(entry.mask_threshold);
  if (!options.scans.empty()) json["scans"] = scan_protocol(dataset, splits, options);
  return json;
}

std::string evaluation_table(const nlohmann::ordered_json& evaluation) {
  std::string out;
  const auto& protocol = evaluation.at("protocol");
  for (const auto& [split, methods] : evaluation.at("splits").items()) {
    out += fmt::format("{} split, {} frames, {} cameras\n", split, protocol.at("frames").at(split).get<long>(),
                       protocol.at("cameras").size());
    if (const auto left_out = protocol.value("left_out", nlohmann::ordered_json::object()); left_out.contains(split))
      out += "  left out: " + left_out.at(split).get<std::string>() + "\n";
    for (const auto& [method, result] : methods.items()) {
      out += fmt::format("  {:<10}", method);
      for (const EvaluationColumn& column : kEvaluationColumns)
        if (const auto* value = column.find(result))
          out += fmt::format("  {} {}{}", column.title, column.text(*value), column.unit);
      out += "  |";
      for (const auto& [camera, value] : result.at("cameras").items())
        out += value.is_number() ? fmt::format("  {}: {:.4f}", camera, value.get<double>())
                                 : fmt::format("  {}: {:.1f}", camera, value.at("MSE").get<double>());
      out += "\n";
    }
  }
  return out;
}

}  // namespace doppel
