#include "doppel/synth/film.h"

#include "doppel/character/landmarks.h"
#include "doppel/core/npy.h"
#include "doppel/core/random.h"
#include "doppel/synth/capture_writer.h"
#include "doppel/synth/simulated_detector.h"
#include "doppel/synth/studio.h"

namespace doppel::synth {

using Eigen::Vector3d;

std::filesystem::path surfaces_file(const std::filesystem::path& root, const std::string& sequence) {
  return root / "ground_truth" / sequence / "vertices.npy";
}

Points as_points(const std::vector<float>& values) {
  Points points;
  for (std::size_t i = 0; i + 2 < values.size(); i += 3)
    points.push_back(Vector3d(values[i], values[i + 1], values[i + 2]));
  return points;
}

bool film_camera(const CaptureSet& set, const std::string& sequence, int number, int camera,
                 const std::function<bool()>& next) {
  const Skeleton& skeleton = set.actor.character.skeleton;
  const Camera& lens = set.cameras[camera];
  const std::filesystem::path folder = set.root / sequence;
  const Motion motion = read_motion(motion_rows_file(folder), skeleton.num_dofs());
  const std::vector<int> body25 = body25_markers(skeleton);
  NpyItems surfaces(surfaces_file(set.root, sequence));
  Studio studio(set.actor, {lens}, {.seed = set.options.seed});
  CameraWriter writer({folder, camera, set.options.keypoint_tables}, lens, set.options.fps);
  for (int frame = 0; frame < motion.num_frames(); ++frame) {
    if (!next()) return false;
    studio.set_surface(as_points(surfaces.read(frame)));
    const Points markers = landmark_positions(skeleton, skeleton.markers, motion.frames[frame]);
    const std::uint64_t key = (static_cast<std::uint64_t>(number) << 40) + static_cast<std::uint64_t>(frame) * 64 +
                              static_cast<std::uint64_t>(camera);
    const std::uint64_t noise = hash_bits(~(key ^ set.options.seed));
    writer.write_shot(studio.shoot(0, key));
    writer.write_keypoints(frame, detect_points(studio, 0, lens, markers, body25, noise));
    writer.write_joints(frame, estimate_joints(lens, markers, body25, frame, noise + 1000));
  }
  writer.close();
  return true;
}

}  // namespace doppel::synth
