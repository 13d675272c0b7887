#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/rig_parts.h"
#include "doppel/calibration/formats/xml_parts.h"

namespace doppel {
namespace {

constexpr int kMetashapeMaxGroups = 16;  // groups of cameras inside of each other

/// From the frame of a chunk or of a component to the world: x -> translation + scale R x.
struct MetashapeTransform {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  double scale = 1;
};

/// A rigid pose: x -> centre + R x.
struct MetashapePose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();

  MetashapePose operator*(const MetashapePose& inner) const { return {R * inner.R, centre + R * inner.centre}; }
  MetashapePose inverse() const { return {R.transpose(), -(R.transpose() * centre)}; }
};

/// The child element of a list with this id.
pugi::xml_node metashape_item(const pugi::xml_node& list, const char* name, const std::string& id) {
  for (const pugi::xml_node& item : list.children(name))
    if (id == item.attribute("id").value()) return item;
  return {};
}

class MetashapeReader {
 public:
  explicit MetashapeReader(const std::filesystem::path& path) : file_(path) {}

  Calibration read() {
    for (const pugi::xml_node& chunk : file_.root().children("chunk"))
      if (chunk.child("cameras") && !chunk_) chunk_ = chunk;
    if (!chunk_)
      fail_at({file_.path().string(), 0}, "reading a camera calibration: the file has no <chunk> with <cameras>");
    find_cameras(chunk_.child("cameras"), 0);
    for (const pugi::xml_node& node : cameras_) read_camera(node);
    note_left_out();
    if (calibration_.cameras.empty())
      fail_at({file_.path().string(), 0}, "reading a camera calibration: the file has no camera that can be used{}{}",
              calibration_.notes.empty() ? "" : ": ", fmt::join(calibration_.notes, "; "));
    settle_world();
    recentre_if_far(calibration_);
    return std::move(calibration_);
  }

 private:
  /// All cameras, also those of groups. A camera may stand before its master.
  void find_cameras(const pugi::xml_node& list, int depth) {
    for (const pugi::xml_node& node : list.children()) {
      if (std::string_view(node.name()) == "group" && depth < kMetashapeMaxGroups) find_cameras(node, depth + 1);
      if (std::string_view(node.name()) != "camera") continue;
      cameras_.push_back(node);
      by_id_.emplace(XmlPart(file_, node, "a camera").text_or("id", ""), node);
    }
  }

  void read_camera(const pugi::xml_node& node) {
    const XmlPart named(file_, node, "a camera");
    const XmlPart part(file_, node, "camera " + named.text("label"));
    const XmlPart posed = camera_with_pose(part);
    if (!posed.has_child("transform")) {
      ++not_aligned_;
      return;
    }
    if (posed.node() != node && !has_offset(sensor_of(part))) {
      ++without_offset_;
      return;
    }
    Camera camera;
    camera.name = unique_name(named.text("label"), part);
    if (!read_sensor(part, camera)) return;
    read_pose(part, posed, camera);
    calibration_.cameras.push_back(camera);
  }

  /// The camera itself or, in a rig, the master that has the pose.
  XmlPart camera_with_pose(const XmlPart& part) const {
    if (part.has_child("transform") || !part.has("master_id")) return part;
    const auto master = by_id_.find(part.text("master_id"));
    if (master == by_id_.end())
      part.fail_here("its master_id is {}, but there is no <camera> with this id", part.text("master_id"));
    return {file_, master->second, part.what() + ": its master"};
  }

  /// Photos of different folders may have the same label.
  std::string unique_name(const std::string& label, const XmlPart& part) {
    if (names_.insert(label).second) return label;
    ++renamed_;
    const std::string name = label + "_" + part.text("id");
    names_.insert(name);
    return name;
  }

  XmlPart sensor_of(const XmlPart& part) const {
    const pugi::xml_node node = metashape_item(chunk_.child("sensors"), "sensor", part.text("sensor_id"));
    if (!node) part.fail_here("there is no <sensor> with the id {}", part.text("sensor_id"));
    return {file_, node, part.what()};
  }

  static bool has_offset(const XmlPart& sensor) { return sensor.has("rotation") || sensor.has("location"); }

  /// The pose of a sensor in its rig.
  static MetashapePose offset_of(const XmlPart& sensor) {
    MetashapePose pose;
    if (sensor.has("rotation")) pose.R = repaired_rotation(matrix_from_rows(sensor.numbers("rotation", 9)));
    if (sensor.has("location")) pose.centre = Eigen::Vector3d(sensor.numbers("location", 3).data());
    return pose;
  }

  /// Whether the camera can be used.
  bool read_sensor(const XmlPart& part, Camera& camera) {
    const XmlPart sensor = sensor_of(part);
    pugi::xml_node calibration = sensor.node().find_child_by_attribute("calibration", "class", "adjusted");
    if (!calibration) calibration = sensor.node().child("calibration");
    const XmlPart values(file_, calibration, part.what());
    const std::string type = values.text_or("type", sensor.text_or("type", "frame"));
    if (!calibration || (type != "frame" && type != "fisheye")) {
      ++other_sensor_;
      return false;
    }
    const XmlPart resolution = (values.has_child("resolution") ? values : sensor).child("resolution");
    camera.width = resolution.pixels("width");
    camera.height = resolution.pixels("height");
    const double f = values.number("f");
    camera.K = intrinsics(f + values.number_or("b1", 0.0), f, 0.5 * camera.width + values.number_or("cx", 0.0),
                          0.5 * camera.height + values.number_or("cy", 0.0), PixelCentre::half);
    camera.K(0, 1) = values.number_or("b2", 0.0);
    read_lens(values, type == "fisheye", camera);
    return true;
  }

  static void read_lens(const XmlPart& values, bool fisheye, Camera& camera) {
    const auto coefficient = [&](const char* key) { return values.number_or(key, 0.0); };
    if (coefficient("p3") != 0.0 || coefficient("p4") != 0.0)
      values.fail_here("the coefficients p3 {} and p4 {} cannot be expressed, only 0 can be read", coefficient("p3"),
                       coefficient("p4"));
    // p1 and p2 are OpenCV's p2 and p1.
    const double k[4] = {coefficient("k1"), coefficient("k2"), coefficient("k3"), coefficient("k4")};
    const double p1 = coefficient("p2"), p2 = coefficient("p1");
    if (!fisheye) {
      const double all[6] = {k[0], k[1], p1, p2, k[2], k[3]};
      return set_distortion(camera, Lens::polynomial, all, values.where());
    }
    if (p1 != 0.0 || p2 != 0.0)
      values.fail_here("a fisheye lens with p1 {} and p2 {} cannot be expressed, only 0 can be read", p2, p1);
    set_distortion(camera, Lens::fisheye, k, values.where());
  }

  /// @param posed the camera that has the pose: the camera itself or its master
  void read_pose(const XmlPart& part, const XmlPart& posed, Camera& camera) {
    const std::vector<double> m = posed.numbers("transform", 16);
    const double rows[9] = {m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]};
    MetashapePose pose{repaired_rotation(matrix_from_rows(rows)), {m[3], m[7], m[11]}};
    // The master's sensor has an offset of its own when the rig is built around another camera.
    if (posed.node() != part.node()) pose = pose * offset_of(sensor_of(posed)).inverse() * offset_of(sensor_of(part));
    const MetashapeTransform world = world_of(posed);
    const Eigen::Matrix3d world_from_camera = world.R * pose.R;
    set_pose_at(camera, world_from_camera.transpose(), world.translation + world.scale * (world.R * pose.centre));
  }

  /// The transform of the chunk; if it has none, that of the component the camera belongs to.
  MetashapeTransform world_of(const XmlPart& part) {
    pugi::xml_node owner = chunk_;
    if (!owner.child("transform"))
      owner = metashape_item(chunk_.child("components"), "component", part.text_or("component_id", ""));
    MetashapeTransform world;
    if (!owner.child("transform")) {
      ++without_world_;
      return world;
    }
    const XmlPart values(file_, owner.child("transform"), "the transform of the " + std::string(owner.name()));
    if (values.has("rotation")) world.R = repaired_rotation(matrix_from_rows(values.numbers("rotation", 9)));
    if (values.has("translation")) world.translation = Eigen::Vector3d(values.numbers("translation", 3).data());
    world.scale = values.number_or("scale", 1.0);
    if (!(world.scale > 0.0)) values.fail_here("scale is {}, it must be positive", world.scale);
    if (!values.has("scale")) ++without_world_;
    return world;
  }

  /// A transform with a scale leads to metres and to a world whose z is up, unless this is the earth's: with every
  /// reference but a local one, the transform leads to the earth's centre.
  void settle_world() {
    calibration_.has_scale = without_world_ == 0;
    if (!calibration_.has_scale) return;
    calibration_.unit = "m";
    const std::string reference = XmlPart(file_, chunk_, "the chunk").text_or("reference", "");
    if (reference.empty() || reference.starts_with("LOCAL_CS")) calibration_.up = "+z";
  }

  void note_left_out() {
    const auto note = [&](int count, const char* sentence) {
      if (count > 0) calibration_.notes.emplace_back(fmt::format(fmt::runtime(sentence), count));
    };
    note(not_aligned_, "{} cameras that are not aligned were left out");
    note(without_offset_,
         "{} cameras of a rig were left out, because their sensors have no <rotation> and <location> from the master");
    note(other_sensor_, "{} cameras whose sensors are neither \"frame\" nor \"fisheye\" were left out");
    note(renamed_, "{} cameras with the label of another camera got their id after the label");
  }

  XmlFile file_;
  pugi::xml_node chunk_;
  std::vector<pugi::xml_node> cameras_;
  std::map<std::string, pugi::xml_node> by_id_;
  std::set<std::string> names_;
  int not_aligned_ = 0, without_offset_ = 0, other_sensor_ = 0, renamed_ = 0, without_world_ = 0;
  Calibration calibration_;
};

/// Cameras of Agisoft Metashape (`cameras.xml`). Semantics: the vendor's manual.
///
/// <transform> of a camera leads from the camera (axes x right, y down, z forward) to the chunk, that of the chunk (or
/// of the component, when the chunk has none) from there to the world, with a scale: X = translation + scale R x. With
/// a scale lengths are metres. In a rig (a multi-camera system) the other cameras have the `master_id` of the camera
/// that has the pose, and their sensors <rotation> and <location> from the camera to the master, in the unit of the
/// chunk. cx and cy are offsets from the centre of the image, b1 is added to f for the horizontal
/// focal length, b2 is the skew, and missing values are 0. The radial polynomial has four coefficients; p1 and p2 stand
/// in the other order than with OpenCV.
class MetashapeCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "metashape"; }

  bool recognises(const CalibrationSource& source) const override {
    const std::string head = readable_head(source);
    return root_element(head) == "document" && head.find("<chunk") != std::string::npos;
  }

  Calibration read(const CalibrationSource& source) const override { return MetashapeReader(source.path).read(); }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_metashape_calibration() { return std::make_unique<MetashapeCalibration>(); }

}  // namespace doppel
