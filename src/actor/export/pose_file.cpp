#include "doppel/actor/export/pose_file.h"

#include "doppel/actor/export/pose_trace.h"

namespace doppel {

void write_pose_file(const std::filesystem::path& path, TrainedPose& trained) {
  TracedPose traced = traced_pose(trained);
  traced.file.save(path, trained.character, traced.metadata);
}

}  // namespace doppel
