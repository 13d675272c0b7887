#include "doppel/data/dataset/batch_builder.h"

#include <algorithm>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/data/dataset/person_crop.h"
#include "doppel/render/recycled.h"

namespace doppel {

namespace {

constexpr float kKeypointWidth = 1024.0f;  // of the images in whose pixels keypoint losses are measured
constexpr double kPersonDetail = 1.25;     // resolution of cached person images, relative to the network's input

using Crops = std::vector<std::shared_ptr<const SilhouetteCrop>>;  // [B*C]

std::size_t bytes_of(const SilhouetteCrop& crop) {
  return sizeof(crop) + crop.distance.size() * sizeof(crop.distance[0]) + crop.contour.size() * sizeof(ContourPixel);
}

std::size_t bytes_of(const ImageCrop& crop) { return sizeof(crop) + crop.rgb.size() + crop.foreground.size(); }

torch::Tensor contour_tensor(const Crops& crops, const torch::Tensor& offsets) {
  auto* offset = offsets.data_ptr<std::int64_t>();
  offset[0] = 0;
  for (std::size_t i = 0; i < crops.size(); ++i)
    offset[i + 1] = offset[i] + static_cast<std::int64_t>(crops[i]->contour.size());
  torch::Tensor points = torch::empty({offset[crops.size()], 2}, torch::kFloat32);
  float* to = points.data_ptr<float>();
  for (const auto& crop : crops)
    for (const ContourPixel& pixel : crop->contour) {
      *to++ = static_cast<float>(pixel.x) + 0.5f;
      *to++ = static_cast<float>(pixel.y) + 0.5f;
    }
  return points;
}

void write_projection(const PinholeCamera& camera, float* to) {
  const Eigen::Matrix<double, 3, 4> projection = camera.projection();
  for (int i = 0; i < 12; ++i) to[i] = static_cast<float>(projection(i / 4, i % 4));
}

/// Projection of the crop's camera. Without a crop, that of the whole image, so that the numbers stay finite.
template <typename Crop>
void write_projection(const PinholeCamera& camera, const Crop& crop, float* to) {
  write_projection(crop.valid ? crop_camera(camera, crop.box, crop.pixels) : camera, to);
}

void write_distance(const SilhouetteCrop& crop, float* to, std::int64_t count) {
  if (!crop.valid) {
    std::fill(to, to + count, 0.0f);
    return;
  }
  const float step = 1.0f / static_cast<float>(crop.steps_per_pixel);
  for (std::int64_t i = 0; i < count; ++i) to[i] = step * static_cast<float>(crop.distance[i]);
}

void write_silhouettes(const Dataset& dataset, const std::vector<SamplePlan::Item>& items, const Crops& crops,
                       Batch& batch) {
  const std::int64_t pixels = std::int64_t{dataset.mask_size()} * dataset.mask_size();
  const std::size_t num_cameras = items[0].cameras.size();
  for (std::size_t i = 0; i < crops.size(); ++i) {
    const SilhouetteCrop& crop = *crops[i];
    const PinholeCamera& camera = dataset.camera(items[i / num_cameras].cameras[i % num_cameras]);
    write_projection(camera, crop, batch.projection.data_ptr<float>() + 12 * i);
    write_distance(crop, batch.distance.data_ptr<float>() + pixels * i, pixels);
    batch.pixel_scale.data_ptr<float>()[i] =
        crop.valid ? static_cast<float>(crop.box.image_pixels_per_pixel(crop.pixels)) : 1.0f;
    batch.valid.data_ptr<bool>()[i] = crop.valid;
  }
}

/// Loads images with their masks and cameras.
void add_images(const Dataset& dataset, CropCache& cache, const std::vector<SamplePlan::Item>& items, int pixels,
                Batch& batch) {
  const std::int64_t b = batch.cameras.size(0), c = batch.cameras.size(1), p = pixels, area = p * p;
  batch.image = render::recycled_empty({b, c, p, p, 3}, torch::kUInt8);
  batch.image_mask = render::recycled_empty({b, c, p, p}, torch::kUInt8);
  batch.image_projection = torch::empty({b, c, 3, 4}, torch::kFloat32);
  for (std::int64_t i = 0; i < b * c; ++i) {
    const SamplePlan::Item& item = items[i / c];
    const int camera = item.cameras[i % c];
    const auto crop = cache.image(dataset, item.sample, camera, pixels);
    write_projection(dataset.camera(camera), *crop, batch.image_projection.data_ptr<float>() + 12 * i);
    auto* image = batch.image.data_ptr<std::uint8_t>() + 3 * area * i;
    auto* mask = batch.image_mask.data_ptr<std::uint8_t>() + area * i;
    if (crop->valid) {
      std::copy(crop->rgb.begin(), crop->rgb.end(), image);
      std::copy(crop->foreground.begin(), crop->foreground.end(), mask);
    } else {
      std::fill(image, image + 3 * area, std::uint8_t{0});
      std::fill(mask, mask + area, std::uint8_t{0});
    }
  }
}

/// Loads keypoints and the cameras of the whole images.
void add_keypoints(const Dataset& dataset, const std::vector<SamplePlan::Item>& items, Batch& batch) {
  dataset.require_landmarks();
  const std::int64_t b = batch.cameras.size(0), c = batch.cameras.size(1);
  const auto m = static_cast<std::int64_t>(dataset.landmarks().size());
  batch.keypoints = torch::empty({b, c, m, 3}, torch::kFloat32);
  batch.keypoint_scale = torch::empty({b, c}, torch::kFloat32);
  batch.camera_projection = torch::empty({b, c, 3, 4}, torch::kFloat32);
  batch.camera_rotation = torch::empty({b, c, 3, 3}, torch::kFloat32);
  batch.camera_position = torch::empty({b, c, 3}, torch::kFloat32);
  for (std::int64_t i = 0; i < b * c; ++i) {
    const SamplePlan::Item& item = items[i / c];
    const int index = item.cameras[i % c];
    const PinholeCamera& camera = dataset.camera(index);
    float* to = batch.keypoints.data_ptr<float>() + 3 * m * i;
    for (const Keypoint& point : dataset.keypoints(item.sample, index)) {
      *to++ = point.x;
      *to++ = point.y;
      *to++ = point.confidence;
    }
    batch.keypoint_scale.data_ptr<float>()[i] = kKeypointWidth / static_cast<float>(camera.width);
    write_projection(camera, batch.camera_projection.data_ptr<float>() + 12 * i);
    for (int k = 0; k < 9; ++k)
      batch.camera_rotation.data_ptr<float>()[9 * i + k] = static_cast<float>(camera.R(k / 3, k % 3));
    const Eigen::Vector3d centre = camera.centre();
    for (int k = 0; k < 3; ++k) batch.camera_position.data_ptr<float>()[3 * i + k] = static_cast<float>(centre[k]);
  }
}

/// The camera of an item for the network's input: the first from `start` on, cyclically, that sees the person; `start`
/// if none does.
int choose_camera(const Dataset& dataset, const SamplePlan::Item& item, int start) {
  const int count = static_cast<int>(item.cameras.size());
  for (int i = 0; i < count; ++i) {
    const int camera = (start + i) % count;
    if (!dataset.crop_box(item.sample, item.cameras[camera]).empty()) return camera;
  }
  return start;
}

/// @return whether the person is seen. @param projection [3,4]
bool write_person_of(const Dataset& dataset, const ImageCrop& crop, const SampleId& sample, int camera,
                     SplitMix* random, int pixels, float* to, float* projection) {
  PersonImage image;
  PersonWindow window;
  if (crop.valid) {
    image.rgb = cv::Mat(crop.pixels, crop.pixels, CV_8UC3, const_cast<std::uint8_t*>(crop.rgb.data()));
    image.foreground = cv::Mat(crop.pixels, crop.pixels, CV_8U, const_cast<std::uint8_t*>(crop.foreground.data()));
    image.u0 = crop.box.u0;
    image.v0 = crop.box.v0;
    image.scale = static_cast<double>(crop.pixels) / crop.box.side;
    const auto keypoints = dataset.landmarks().empty() ? std::vector<Keypoint>() : dataset.keypoints(sample, camera);
    window = person_window(keypoints, image.mask_box());
  }
  const bool seen = !window.empty();
  if (!seen) {  // a black image with the camera of the whole image
    image.rgb = cv::Mat::zeros(1, 1, CV_8UC3);
    image.foreground = cv::Mat::zeros(1, 1, CV_8U);
    window = {0.0, 0.0, 1.0};
  }
  if (random) window = draw_window(window, *random);
  write_person(image, window, random ? draw_photometry(*random) : Photometry(), pixels, to);
  const PinholeCamera& whole = dataset.camera(camera);
  write_projection(seen ? window.camera(whole, pixels) : whole, projection);
  return seen;
}

/// Loads the network's image of the person in one camera of each sample.
void add_people(const Dataset& dataset, CropCache& cache, const std::vector<SamplePlan::Item>& items,
                const BatchOptions& options, Batch& batch) {
  const std::int64_t b = batch.cameras.size(0), s = options.person_size;
  const int stored = std::min(dataset.image_size(), static_cast<int>(kPersonDetail * options.person_size));
  batch.person = torch::empty({b, 1, 3, s, s}, torch::kFloat32);
  batch.person_camera = torch::empty({b}, torch::kInt64);
  batch.person_projection = torch::empty({b, 1, 3, 4}, torch::kFloat32);
  batch.person_valid = torch::empty({b}, torch::kBool);
  for (std::int64_t i = 0; i < b; ++i) {
    const SamplePlan::Item& item = items[i];
    SplitMix random(item.seed);
    const int start = options.augment ? static_cast<int>(random.below(item.cameras.size())) : 0;
    const int chosen = choose_camera(dataset, item, start);
    const int camera = item.cameras[chosen];
    const auto crop = cache.person(dataset, item.sample, camera, stored);
    batch.person_camera.data_ptr<std::int64_t>()[i] = chosen;
    batch.person_valid.data_ptr<bool>()[i] = write_person_of(
        dataset, *crop, item.sample, camera, options.augment ? &random : nullptr, options.person_size,
        batch.person.data_ptr<float>() + 3 * s * s * i, batch.person_projection.data_ptr<float>() + 12 * i);
  }
}

std::uint64_t key_of(const SampleId& sample, int camera) {
  return static_cast<std::uint64_t>(sample.sequence) << 48 | static_cast<std::uint64_t>(camera) << 36 |
         static_cast<std::uint64_t>(sample.frame);
}

}  // namespace

template <typename Crop, typename Make>
std::shared_ptr<const Crop> CropCache::get(Items<Crop>& items, std::uint64_t key, const Make& make) {
  {
    std::lock_guard lock(mutex_);
    const auto found = items.find(key);
    if (found != items.end()) return found->second;
  }
  auto crop = std::make_shared<const Crop>(make());
  std::lock_guard lock(mutex_);
  const std::size_t bytes = bytes_of(*crop);
  if (bytes_ + bytes <= max_bytes_ && items.emplace(key, crop).second) bytes_ += bytes;
  return crop;
}

std::shared_ptr<const SilhouetteCrop> CropCache::silhouette(const Dataset& dataset, const SampleId& sample,
                                                            int camera) {
  return get(silhouettes_, key_of(sample, camera), [&] { return dataset.silhouette(sample, camera); });
}

std::shared_ptr<const ImageCrop> CropCache::image(const Dataset& dataset, const SampleId& sample, int camera,
                                                  int pixels) {
  return get(images_, key_of(sample, camera), [&] { return dataset.image(sample, camera, pixels); });
}

std::shared_ptr<const ImageCrop> CropCache::person(const Dataset& dataset, const SampleId& sample, int camera,
                                                   int pixels) {
  return get(people_, key_of(sample, camera), [&] { return dataset.image(sample, camera, pixels); });
}

Batch build_batch(const Dataset& dataset, CropCache& cache, const std::vector<SamplePlan::Item>& items,
                  const BatchOptions& options) {
  const auto b = static_cast<std::int64_t>(items.size());
  const auto c = static_cast<std::int64_t>(items.empty() ? 0 : items[0].cameras.size());
  if (b == 0 || c == 0) fail<UsageError>("a batch needs at least one sample and one camera");
  const std::int64_t s = dataset.mask_size();
  Batch batch;
  batch.frames = torch::empty({b}, torch::kInt64);
  batch.sequence = torch::empty({b}, torch::kInt64);
  batch.cameras = torch::empty({b, c}, torch::kInt64);
  batch.projection = torch::empty({b, c, 3, 4}, torch::kFloat32);
  // Recycled: the heap would cut freed blocks of this size into crops for the cache, and grow with every batch.
  batch.distance = render::recycled_empty({b, c, s, s}, torch::kFloat32);
  batch.pixel_scale = torch::empty({b, c}, torch::kFloat32);
  batch.valid = torch::empty({b, c}, torch::kBool);
  batch.contour_offsets = torch::empty({b * c + 1}, torch::kInt64);

  const bool any_motion = std::any_of(items.begin(), items.end(), [&](const SamplePlan::Item& item) {
    return dataset.sequences().at(as_size(item.sample.sequence)).has_motion();
  });
  Crops crops;
  std::vector<torch::Tensor> windows;
  for (std::int64_t i = 0; i < b; ++i) {
    const SamplePlan::Item& item = items[i];
    if (static_cast<std::int64_t>(item.cameras.size()) != c)
      fail<UsageError>("the samples of a batch must have the same number of cameras; found {} and {}", c,
                       item.cameras.size());
    batch.frames.data_ptr<std::int64_t>()[i] = item.sample.frame;
    batch.sequence.data_ptr<std::int64_t>()[i] = item.sample.sequence;
    if (any_motion) windows.push_back(dataset.dof_window(item.sample, options.past_frames));
    for (std::int64_t j = 0; j < c; ++j) {
      batch.cameras.data_ptr<std::int64_t>()[i * c + j] = item.cameras[j];
      crops.push_back(cache.silhouette(dataset, item.sample, item.cameras[j]));
    }
  }
  if (any_motion) batch.dofs = torch::stack(windows);
  write_silhouettes(dataset, items, crops, batch);
  batch.contour = contour_tensor(crops, batch.contour_offsets);
  if (options.keypoints) add_keypoints(dataset, items, batch);
  if (options.person_size > 0) add_people(dataset, cache, items, options, batch);
  if (options.images) add_images(dataset, cache, items, dataset.image_pixels(options.image_size), batch);
  return batch;
}

Batch make_batch(const Dataset& dataset, const std::vector<SampleId>& samples,
                 const std::vector<std::vector<int>>& cameras, const BatchOptions& options) {
  if (samples.size() != cameras.size())
    fail<UsageError>("a batch of {} samples was given cameras for {}", samples.size(), cameras.size());
  std::vector<SamplePlan::Item> items;
  for (std::size_t i = 0; i < samples.size(); ++i) items.push_back({samples[i], cameras[i], i});
  CropCache no_cache(0);
  return build_batch(dataset, no_cache, items, options);
}

}  // namespace doppel
