#pragma once

#include <filesystem>
#include <map>

#include "doppel/core/error.h"
#include "doppel/detect/keypoints/format.h"

namespace doppel {

/// Reads a keypoint file of any format. The content decides the format, not the name; docs/capture.md lists them.
/// Coordinates are those of the file; `unit` says whether they are pixels or fractions of the image's size. Fractions
/// are recognised by their size when the format does not fix the unit: a body of pixels is larger than 1.5.
/// @throws FileError for a file of an unknown kind, or one that is truncated or impossible
Detections read_detections(const std::filesystem::path& path, const KeypointCamera& camera = {});

/// Reads the people of one image, in pixels and in the order of the layout. Points that the file names go by their
/// names, all others by their order. If the file has face, hands or feet beside the body, the layout may be that of the
/// body, or of body, feet, face, left hand and right hand in this order. A person without any seen point is nobody.
/// @throws FileError: as read_detections; another number of points than the layout has; names that contradict the
/// layout; fractions of an image whose size `camera` does not state
People read_people(const std::filesystem::path& path, const PointLayout& layout, const KeypointCamera& camera = {});

/// Reads a file of all images of one camera. The frame is what the file states (`frame_id`, a frame column, a number as
/// COCO's image_id), otherwise the last number in the image's file name. If these numbers are not unique, it is the
/// position of the name in natural order, and a warning is logged. MMPose's demo scripts count from 1, which becomes 0.
/// @return by frame; frames without people may be missing
/// @throws FileError as read_people, and for images without a frame number and a name
std::map<long, People> read_all_people(const std::filesystem::path& path, const PointLayout& layout,
                                       const KeypointCamera& camera = {});

}  // namespace doppel
