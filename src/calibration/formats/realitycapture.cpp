#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <map>
#include <numbers>
#include <span>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/rig_parts.h"
#include "doppel/calibration/formats/xml_parts.h"
#include "doppel/core/file_head.h"
#include "doppel/core/lower_case.h"
#include "doppel/core/text_reader.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

constexpr double kRealityFilmWidth = 36;  // millimetres; focal lengths are those of 35 mm film
constexpr std::size_t kRealityHeadBytes = 16 << 10;
constexpr int kRealityMaxProbes = 100;  // XMP files of a folder that are looked at to recognise it
constexpr const char* kRealitySizeNote =
    "the size of the images is not stated; the intrinsics are in units of their longer side, from their centre";

bool is_reality_xmp(std::string_view head) {
  const std::string_view root = root_element(head);
  return (root == "x:xmpmeta" || root == "rdf:RDF") && head.find("capturingreality.com") != std::string_view::npos;
}

bool is_reality_xmp_file(const fs::path& path) {
  return is_reality_xmp(readable_head({path, read_head(path, kRealityHeadBytes), false}));
}

/// The XMP files of a folder, sorted by name; empty when it cannot be read.
std::vector<fs::path> reality_xmp_files(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator item(folder, error), end; !error && item != end; item.increment(error)) {
    std::error_code ignored;
    if (lower_case(item->path().extension().string()) == ".xmp" && item->is_regular_file(ignored))
      files.push_back(item->path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Whether a line is the first one of some tables, "#cameras 706".
bool is_reality_count(std::string_view line) {
  return line.substr(0, 1) == "#" && line.find(',') == std::string_view::npos;
}

/// The columns of a table by their names in lower case, without blanks and the leading #.
std::map<std::string, std::size_t> reality_columns(std::span<const std::string_view> header) {
  std::map<std::string, std::size_t> columns;
  for (std::size_t i = 0; i < header.size(); ++i) {
    std::string name = lower_case(std::string(header[i]));
    std::erase_if(name, [](char c) { return c == '#' || c == ' '; });
    columns.emplace(name, i);
  }
  // Names that changed between versions of the program.
  if (!columns.contains("z") && columns.contains("alt")) columns["z"] = columns["alt"];
  if (!columns.contains("heading") && columns.contains("yaw")) columns["heading"] = columns["yaw"];
  return columns;
}

bool reality_has_columns(const std::map<std::string, std::size_t>& columns, std::initializer_list<const char*> names) {
  return std::all_of(names.begin(), names.end(), [&](const char* name) { return columns.contains(name); });
}

bool reality_has_angles(const std::map<std::string, std::size_t>& columns) {
  return reality_has_columns(columns, {"omega", "phi", "kappa"}) ||
         reality_has_columns(columns, {"heading", "pitch", "roll"});
}

Eigen::Matrix3d reality_turn(const Eigen::Vector3d& axis, double degrees) {
  return Eigen::AngleAxisd(degrees * std::numbers::pi / 180.0, axis).toRotationMatrix();
}

/// Camera from world.
Eigen::Matrix3d reality_omega_phi_kappa(double omega, double phi, double kappa) {
  Eigen::Matrix3d left, right;
  left << 0, 1, 0, 0, 0, -1, 1, 0, 0;
  right << 0, 0, -1, 1, 0, 0, 0, 1, 0;
  return left * reality_turn(Eigen::Vector3d::UnitX(), omega) * reality_turn(Eigen::Vector3d::UnitY(), phi) *
         reality_turn(Eigen::Vector3d::UnitZ(), kappa) * right;
}

/// Camera from world. The angles turn a camera that looks down with its upper edge to the north (y): by the heading
/// clockwise as seen from above, by the pitch up to the horizon at 90 degrees.
Eigen::Matrix3d reality_heading_pitch_roll(double heading, double pitch, double roll) {
  const Eigen::Matrix3d world_from_camera_up = reality_turn(Eigen::Vector3d::UnitZ(), -heading) *
                                               reality_turn(Eigen::Vector3d::UnitX(), pitch) *
                                               reality_turn(Eigen::Vector3d::UnitY(), roll);
  return Eigen::Vector3d(1, -1, -1).asDiagonal() * world_from_camera_up.transpose();
}

/// Builds the cameras of XMP files and tables.
class RealityReader {
 public:
  explicit RealityReader(const fs::path& path) : path_(path) {
    calibration_.unit = "m";
    calibration_.up = "+z";
  }

  Calibration read_folder() {
    for (const fs::path& file : reality_xmp_files(path_)) {
      if (is_reality_xmp_file(file))
        read_xmp(file);
      else
        ++other_files_;
    }
    return finished();
  }

  Calibration read_file(const std::string& head) {
    if (is_reality_xmp(head))
      read_xmp(path_);
    else
      read_table();
    return finished();
  }

 private:
  Calibration finished() {
    if (calibration_.cameras.empty())
      fail_at({path_.string(), 0}, "reading a camera calibration: there are no cameras of RealityCapture");
    // A file of intrinsics alone is a calibration too; among files with poses it cannot be used.
    calibration_.has_poses = without_pose_.size() < calibration_.cameras.size();
    if (calibration_.has_poses) {
      std::erase_if(calibration_.cameras, [&](const Camera& camera) {
        return std::find(without_pose_.begin(), without_pose_.end(), camera.name) != without_pose_.end();
      });
      note(without_pose_.size(), "{} cameras without a pose were left out");
    }
    note(other_files_, "{} XMP files of other programs were left out");
    if (tangential_)
      calibration_.notes.emplace_back("the order of t1 and t2 is not documented; they were taken as p2 and p1");
    calibration_.notes.emplace_back(kRealitySizeNote);
    if (calibration_.has_poses) recentre_if_far(calibration_);
    return std::move(calibration_);
  }

  void note(std::size_t count, const char* sentence) {
    if (count > 0) calibration_.notes.emplace_back(fmt::format(fmt::runtime(sentence), count));
  }

  void read_xmp(const fs::path& path) {
    const XmlFile file(path);
    const std::string name = path.stem().string();
    const XmlPart part(file, xmp_description(file.root()), "camera " + name);
    if (!part.node())
      fail_at({path.string(), 0}, "reading a camera calibration: there is no rdf:Description with xcr: values");
    Camera camera;
    camera.name = name;
    for (const auto& [key, wanted] : {std::pair{"xcr:Skew", 0.0}, std::pair{"xcr:AspectRatio", 1.0}})
      if (part.number_or(key, wanted) != wanted)
        part.fail_here("{} is {}, only {} can be read", key, part.number(key), wanted);
    camera.K = relative_intrinsics(part.number("xcr:FocalLength35mm"), part.number_or("xcr:PrincipalPointU", 0.0),
                                   part.number_or("xcr:PrincipalPointV", 0.0));
    read_xmp_lens(part, camera);
    if (part.has("xcr:Rotation") && part.has("xcr:Position")) {
      const std::vector<double> centre = part.numbers("xcr:Position", 3);
      set_pose_at(camera, repaired_rotation(matrix_from_rows(part.numbers("xcr:Rotation", 9))),
                  {centre[0], centre[1], centre[2]});
      if (part.text_or("xcr:Coordinates", "absolute") != "absolute") calibration_.unit.clear();
    } else {
      without_pose_.push_back(name);
    }
    calibration_.cameras.push_back(camera);
  }

  /// The element with the camera's values.
  static pugi::xml_node xmp_description(const pugi::xml_node& root) {
    const pugi::xml_node rdf = std::string_view(root.name()) == "rdf:RDF" ? root : root.child("rdf:RDF");
    for (const pugi::xml_node& node : rdf.children("rdf:Description"))
      if (node.attribute("xcr:FocalLength35mm") || node.child("xcr:FocalLength35mm")) return node;
    return rdf.child("rdf:Description");
  }

  void read_xmp_lens(const XmlPart& part, Camera& camera) {
    std::vector<double> all;
    for (const char* key : {"xcr:DistortionCoeficients", "xcr:DistortionCoefficients"})
      if (part.has(key)) all = part.numbers(key, 0);
    if (all.size() > 6) part.fail_here("there are {} coefficients of distortion, expected 6", all.size());
    all.resize(6, 0.0);
    const std::string model = part.text_or("xcr:DistortionModel", "brown4t2");
    if (model == "perspective" || std::all_of(all.begin(), all.end(), [](double c) { return c == 0.0; })) return;
    if (model.rfind("brown", 0) != 0)
      part.fail_here("xcr:DistortionModel is \"{}\", allowed are perspective, brown3, brown4, brown3t2 and brown4t2",
                     model);
    set_lens(camera, {all[0], all[1], all[2], all[3]}, all[4], all[5], part.where());
  }

  /// In units of the longer side of the image, from its centre.
  static Eigen::Matrix3d relative_intrinsics(double focal_length, double u, double v) {
    const double f = focal_length / kRealityFilmWidth;
    return intrinsics(f, f, u, v, PixelCentre::half);
  }

  /// @param k,t1,t2 as in the file
  void set_lens(Camera& camera, const std::array<double, 4>& k, double t1, double t2, const FileLocation& where) {
    tangential_ = tangential_ || t1 != 0.0 || t2 != 0.0;
    const double all[6] = {k[0], k[1], t2, t1, k[2], k[3]};
    set_distortion(camera, Lens::polynomial, all, where);
  }

  void read_table() {
    TextReader reader(path_, "a camera calibration", Separator::comma);
    reader.require_line("the header of the table");
    if (is_reality_count(reader.line())) reader.require_line("the header of the table");
    const auto columns = reality_columns(reader.tokens());
    const std::size_t width = reader.tokens().size();
    if (!reality_has_columns(columns, {"name", "x", "y", "z"}) || !reality_has_angles(columns))
      reader.fail_here(
          "reading a camera calibration: the table must have the columns name, x, y, z (or alt) and omega, phi, kappa "
          "or "
          "heading (or yaw), pitch, roll");
    if (!columns.contains("f"))
      reader.fail_here(
          "reading a camera calibration: the table holds poses only, the intrinsics are missing (the column f, and px, "
          "py, k1, k2, k3, k4, t1, t2); export \"Internal/External camera parameters\", or XMP files");
    while (reader.next_row(width)) read_row(reader, columns);
  }

  void read_row(const TextReader& reader, const std::map<std::string, std::size_t>& columns) {
    const auto value = [&](const char* column) { return reader.number(columns.at(column), column); };
    const auto value_or_0 = [&](const char* column) { return columns.contains(column) ? value(column) : 0.0; };
    Camera camera;
    camera.name = std::string(reader.tokens()[columns.at("name")]);
    camera.K = relative_intrinsics(value("f"), value_or_0("px"), value_or_0("py"));
    set_lens(camera, {value_or_0("k1"), value_or_0("k2"), value_or_0("k3"), value_or_0("k4")}, value_or_0("t1"),
             value_or_0("t2"), reader.where());
    const Eigen::Matrix3d R = reality_has_columns(columns, {"omega", "phi", "kappa"})
                                  ? reality_omega_phi_kappa(value("omega"), value("phi"), value("kappa"))
                                  : reality_heading_pitch_roll(value("heading"), value("pitch"), value("roll"));
    set_pose_at(camera, R, {value("x"), value("y"), value("z")});
    calibration_.cameras.push_back(camera);
  }

  fs::path path_;
  std::vector<std::string> without_pose_;
  std::size_t other_files_ = 0;
  bool tangential_ = false;
  Calibration calibration_;
};

/// Cameras of RealityCapture and RealityScan: an XMP file per image, a folder of them, or a table (CSV). Semantics: the
/// vendor's page on the camera of XMP files; the angles and the table as nerfstudio reads them.
///
/// X_cam = R (X - Position), axes x right, y down, z forward; z of the world is up and lengths are metres, unless
/// xcr:Coordinates is "relative". Lengths in the image are in units of its longer side, whose size is not in the files:
/// f = FocalLength35mm / 36, and the principal point is measured from the centre. The coefficients are k1 k2 k3 k4 t1
/// t2 for coordinates at depth 1; t1 and t2 are OpenCV's p2 and p1. A value may be an attribute or an element.
class RealitycaptureCalibration : public CalibrationFormat {
 public:
  std::string name() const override { return "realitycapture"; }

  bool recognises(const CalibrationSource& source) const override {
    if (source.is_folder) return recognises_folder(source.path);
    const std::string head = readable_head(source);
    return is_reality_xmp(head) || is_table(head);
  }

  Calibration read(const CalibrationSource& source) const override {
    if (source.is_folder) return RealityReader(source.path).read_folder();
    return RealityReader(source.path).read_file(readable_head(source));
  }

 private:
  static bool recognises_folder(const fs::path& path) {
    std::vector<fs::path> files = reality_xmp_files(path);
    if (files.size() > kRealityMaxProbes) files.resize(kRealityMaxProbes);
    return std::any_of(files.begin(), files.end(), is_reality_xmp_file);
  }

  /// A table with the name of the image, a position and angles.
  static bool is_table(std::string_view head) {
    if (head.substr(0, 3) == "\xEF\xBB\xBF") head.remove_prefix(3);
    std::string_view line = head.substr(0, head.find('\n'));
    if (is_reality_count(line)) {
      head.remove_prefix(std::min(line.size() + 1, head.size()));
      line = head.substr(0, head.find('\n'));
    }
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    std::vector<std::string_view> header;
    while (!line.empty()) {
      header.push_back(line.substr(0, line.find(',')));
      line.remove_prefix(std::min(header.back().size() + 1, line.size()));
    }
    const auto columns = reality_columns(header);
    return reality_has_columns(columns, {"name", "x", "y", "z"}) && reality_has_angles(columns);
  }
};

}  // namespace

std::unique_ptr<CalibrationFormat> make_realitycapture_calibration() {
  return std::make_unique<RealitycaptureCalibration>();
}

}  // namespace doppel
