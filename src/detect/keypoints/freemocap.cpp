#include "doppel/core/npy.h"
#include "doppel/detect/keypoints/format.h"
#include "doppel/detect/keypoints/json_parts.h"

namespace doppel {

namespace {

constexpr std::int64_t kMediaPipeBody = 33;

/// The 2D arrays of FreeMoCap, `mediapipe...2dData_numCams_numFrames_numTrackedPoints_pixelXY.npy`: [cameras, frames,
/// points, 2 or 3] pixels, NaN where nothing was found. The first 33 points are those of MediaPipe Pose; hands and face
/// follow. Cameras are in the order of the calibration. There is no confidence, and the third number, a depth relative
/// to the hips, is not used.
class FreeMoCapKeypoints : public KeypointFormat {
 public:
  std::string name() const override { return "freemocap"; }
  bool recognises(const KeypointFile& file) const override { return file.head.starts_with("\x93NUMPY"); }
  Detections read(const KeypointFile& file, const KeypointCamera& camera) const override {
    const FileLocation where{file.path.string(), 0};
    const NpyArray array = read_npy(file.path);
    if (array.shape.size() != 4 || array.shape[3] < 2 || array.shape[3] > 3 || array.shape[2] < 1)
      fail_at(where, "reading keypoints: expected FreeMoCap's array [cameras, frames, points, 2 or 3], found {} axes",
              array.shape.size());
    if (camera.index < 0 || camera.index >= array.shape[0])
      fail_at(where, "reading keypoints: the array holds the cameras 0 to {} of the calibration; asked was for {}",
              array.shape[0] - 1, camera.index);
    Detections result;
    result.unit = PointUnit::pixels;
    const std::vector<double> values = array.as<double>();
    const std::int64_t frames = array.shape[1], points = array.shape[2], step = array.shape[3];
    for (std::int64_t f = 0; f < frames; ++f) {
      DetectedPerson person;
      for (std::int64_t p = 0; p < points; ++p) {
        const double* at = &values[((camera.index * frames + f) * points + p) * step];
        (p < kMediaPipeBody ? person.body : person.rest).push_back(keypoint_of(at[0], at[1], 1.0));
      }
      result.images.push_back({f, "", {std::move(person)}});
    }
    return result;
  }
};

}  // namespace

std::unique_ptr<KeypointFormat> make_freemocap_keypoints() { return std::make_unique<FreeMoCapKeypoints>(); }

}  // namespace doppel
