#include "doppel/rigging/scan/orientation.h"

#include <Eigen/Geometry>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

#include "doppel/core/angles.h"
#include "doppel/core/error.h"
#include "doppel/geometry/decompositions.h"
#include "doppel/rigging/scan/body_shape.h"
#include "doppel/rigging/scan/scan_parts.h"

namespace doppel {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;

struct LengthUnit {
  const char* name;
  double metres;
  double share;  ///< how often scans come in it
};
constexpr std::array<LengthUnit, 6> kUnits{{{"m", 1.0, 1.0},
                                            {"cm", 0.01, 1.0},
                                            {"mm", 0.001, 1.0},
                                            {"inch", 0.0254, 0.15},
                                            {"foot", 0.3048, 0.03},
                                            {"dm", 0.1, 0.03}}};
constexpr const char* kUnitNames = "m, cm, mm, dm, inch, foot, or a number of metres";
constexpr double kMinHeight = 0.5, kMaxHeight = 2.8;            // metres; with raised arms
constexpr double kMinGivenHeight = 0.2, kMaxGivenHeight = 4.0;  // if the user names the unit
constexpr double kSure = 0.9;
constexpr double kUpsideDown = -3.0;             // logarithm of odds that a way up is right
constexpr double kClearAxis = 0.5, kLies = 0.5;  // elongation of a body, and cosine between its axis and up
constexpr double kLeans = 0.26;                  // radians: 15 degrees
constexpr double kFlat = 1e-3;                   // thickness over length; a person has 0.1
constexpr double kFloorOdds = 6.0;               // logarithm of odds that a floor is below
constexpr std::array<const char*, 6> kAxisNames{"+x", "-x", "+y", "-y", "+z", "-z"};

/// How usual a height is, up to a factor: adults, then children, then anybody, then raised arms.
double height_density(double metres) {
  double density = std::exp(-0.5 * std::pow((metres - 1.70) / 0.12, 2));
  if (metres > 0.9 && metres < 2.1) density += 0.25;
  if (metres > kMinHeight && metres < 2.3) density += 0.05;
  if (metres > kMinHeight && metres < kMaxHeight) density += 0.01;
  return density;
}

LengthUnit parse_unit(const std::string& text) {
  for (const LengthUnit& unit : kUnits)
    if (text == unit.name) return unit;
  double metres = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), metres);
  if (error != std::errc() || end != text.data() + text.size() || !(metres > 0.0) || !std::isfinite(metres))
    fail<UsageError>("finding the unit of the scan: \"{}\" is no unit; allowed are {}", text, kUnitNames);
  return {"", metres, 1.0};
}

int parse_up(const std::string& text) {
  const std::string signed_text = text.size() == 1 ? "+" + text : text;
  for (std::size_t k = 0; k < kAxisNames.size(); ++k)
    if (signed_text == kAxisNames[k]) return static_cast<int>(k);
  fail<UsageError>("finding the up axis of the scan: \"{}\" is no axis; allowed are x, y, z, -x, -y, -z", text);
}

double odds_to_confidence(double odds) { return 1.0 / (1.0 + std::exp(-odds)); }

/// An image on a sheet, or a scan of which one axis is lost.
void refuse_flat(const TriangleMesh& mesh) {
  Vector3d sum = Vector3d::Zero();
  double count = 0.0;
  const auto each_corner = [&](const auto& use) {
    for (const Triangle& face : mesh.faces)
      for (const int v : face)
        if (const Vector3d& x = mesh.vertices[v]; x.allFinite()) use(x);
  };
  each_corner([&](const Vector3d& x) {
    sum += x;
    count += 1.0;
  });
  const Vector3d centre = sum / std::max(count, 1.0);
  Matrix3d spread = Matrix3d::Zero();
  each_corner([&](const Vector3d& x) { spread += (x - centre) * (x - centre).transpose(); });
  const Vector3d spreads = symmetric_eigen(spread).values;
  if (count > 0 && std::isfinite(spreads[2]) && spreads[0] <= kFlat * kFlat * spreads[2])
    fail<UsageError>(
        "finding the orientation of the scan: all triangles lie in one plane, so there is no body; a scan of the "
        "person "
        "from all sides is needed");
}

class OrientationFinder {
 public:
  OrientationFinder(const TriangleMesh& mesh, const OrientationOptions& options)
      : options_(options), body_(coarse_body(mesh)) {}

  ScanOrientation run() {
    measure_axes();
    if (!options_.up.empty())
      take_up();
    else if (options_.file_up.empty() || !take_file_up())
      find_up();
    find_shape();
    find_unit();
    find_way();
    return std::move(out_);
  }

 private:
  Vector3d up() const { return axis_direction(up_); }

  void measure_axes() {
    Vector3d centre = Vector3d::Zero();
    for (const Vector3d& cell : body_.cells) centre += cell;
    centre_ = centre / static_cast<double>(body_.cells.size());
    Matrix3d spread = Matrix3d::Zero();
    for (const Vector3d& cell : body_.cells) spread += (cell - centre_) * (cell - centre_).transpose();
    const auto [spreads, axes] = symmetric_eigen(spread / static_cast<double>(body_.cells.size()));
    longest_ = axes.col(2);
    // The share of the spread along the longest axis that the next one does not have.
    elongation_ = spreads[2] > 0.0 ? 1.0 - spreads[1] / spreads[2] : 0.0;
    out_.floor = body_.floor_direction >= 0;
    out_.shape.largest_share = body_.largest_share;
  }

  void find_up() {
    int axis = 0;
    longest_.cwiseAbs().maxCoeff(&axis);
    if (body_.floor_direction >= 0) axis = body_.floor_direction / 2;
    const UpCues plus = up_cues(body_, 2 * axis);
    double odds = plus.score();
    if (body_.floor_direction >= 0) odds += body_.floor_direction % 2 == 0 ? kFloorOdds : -kFloorOdds;
    up_ = 2 * axis + (odds >= 0.0 ? 0 : 1);
    out_.up = kAxisNames[up_];
    const double along = std::abs(longest_[axis]);
    const double axis_confidence =
        body_.floor_direction >= 0 ? 1.0
                                   : std::clamp(elongation_ / 0.5, 0.0, 1.0) * std::clamp(2.0 * along - 0.9, 0.0, 1.0);
    out_.up_confidence = axis_confidence * (2.0 * odds_to_confidence(std::abs(odds)) - 1.0);
    explain_up(up_cues(body_, up_));
  }

  void explain_up(const UpCues& cues) {
    std::vector<std::string> why;
    if (out_.floor) why.emplace_back("a floor lies at its lower end");
    why.push_back(fmt::format("the body is longest along {}", out_.up.substr(1)));
    if (cues.gap_below > cues.gap_above + 0.02)
      why.push_back(fmt::format("the lower {:.0f} % of its axis run between the legs", 100.0 * cues.gap_below));
    if (cues.flat_below > cues.flat_above) why.emplace_back("its lower end is flat as soles are");
    out_.reasons.push_back(fmt::format("Up: {}, because {}.", out_.up, fmt::join(why, ", ")));
    if (out_.up_confidence < 0.5)
      out_.reasons.emplace_back("The shape hardly tells what is up; look at the image, or give --up.");
  }

  /// @return whether the shape does not speak against what the file says
  bool take_file_up() {
    up_ = parse_up(options_.file_up);
    const bool lies = elongation_ > kClearAxis && std::abs(longest_.dot(up())) < kLies;
    if (lies || up_cues(body_, up_).score() < kUpsideDown) {
      out_.reasons.push_back(fmt::format("The file says that {} is up, which the shape contradicts: {}.",
                                         kAxisNames[up_],
                                         lies ? "the person would lie" : "the person would be upside down"));
      return false;
    }
    out_.up = kAxisNames[up_];
    out_.reasons.push_back(fmt::format("Up: {}, as the file says.", out_.up));
    return true;
  }

  void take_up() {
    up_ = parse_up(options_.up);
    out_.up = kAxisNames[up_];
    out_.up_confidence = 1.0;
    out_.reasons.push_back(fmt::format("Up: {}, as given.", out_.up));
    const double odds = up_cues(body_, up_).score();
    if (odds < kUpsideDown)
      out_.reasons.push_back(fmt::format("The shape looks upside down; if it is, give --up {}.", kAxisNames[up_ ^ 1]));
  }

  double file_height() const { return std::abs((body_.box.max() - body_.box.min()).dot(up())); }

  void find_shape() {
    const UpCues cues = up_cues(body_, up_);
    const double height = file_height();
    out_.shape.balance = cues.balance;
    out_.shape.legs = cues.gap_below;
    out_.shape.volume = body_.solid.volume() / std::pow(height, 3);
    out_.shape.lean = std::acos(std::clamp(std::abs(longest_.dot(up())), 0.0, 1.0));
    facing_ = find_facing(body_, up_);
    const Vector3d front = facing_ ? facing_->direction : Vector3d(up().unitOrthogonal()), right = up().cross(front);
    const auto extent = [&](const Vector3d& axis) {
      double low = std::numeric_limits<double>::infinity(), high = -low;
      for (const Vector3d& cell : body_.cells) {
        low = std::min(low, cell.dot(axis));
        high = std::max(high, cell.dot(axis));
      }
      return (high - low + body_.solid.cell_size()) / height;
    };
    out_.shape.width = extent(right);
    out_.shape.thickness = extent(front);
    if (!facing_ && out_.shape.thickness > out_.shape.width) std::swap(out_.shape.width, out_.shape.thickness);
    if (elongation_ > kClearAxis && out_.shape.lean > kLeans)
      out_.reasons.push_back(fmt::format(
          "The body leans by {:.0f} degrees. If the person stood upright, turn the scan; the character keeps "
          "the scan's vertical.",
          out_.shape.lean / kRadiansPerDegree));
  }

  void find_unit() {
    const double height = file_height();
    if (!options_.unit.empty()) return take_unit(height);
    if (options_.file_unit && take_file_unit(height)) return;
    const LengthUnit* best = nullptr;
    const LengthUnit* second = nullptr;
    double worth = 0.0, second_worth = 0.0, total = 0.0;
    for (const LengthUnit& unit : kUnits) {
      const double here = unit.share * height_density(height * unit.metres);
      if (height * unit.metres < kMinHeight || height * unit.metres > kMaxHeight) continue;
      total += here;
      if (here > worth) {
        second = best;
        second_worth = worth;
        best = &unit;
        worth = here;
      } else if (here > second_worth) {
        second = &unit;
        second_worth = here;
      }
    }
    if (best == nullptr)
      fail<UsageError>(
          "finding the unit of the scan: it is {:.4g} units high along {}, and no unit (m, cm, mm, dm, inch, foot) "
          "makes "
          "this the height of a person, {} to {} m; give --unit with the metres of one unit, or --up if {} is not up",
          height, out_.up, kMinHeight, kMaxHeight, out_.up);
    set_unit(*best, height);
    out_.unit_confidence = worth / total;
    out_.reasons.push_back(
        fmt::format("Unit: {}, because this makes the person {:.2f} m high.", best->name, out_.height));
    if (out_.unit_confidence < kSure && second != nullptr)
      out_.reasons.push_back(fmt::format("It could also be {}, with {:.2f} m; then give --unit {}.", second->name,
                                         height * second->metres, second->name));
    if (std::abs(height - 1.0) < 1e-3 || std::abs(height - 2.0) < 1e-3)
      out_.reasons.push_back(fmt::format(
          "The scan is exactly {:.0f} units high, so it may have been scaled to this size; then give --unit with the "
          "metres of one unit.",
          height));
  }

  /// @return whether the unit of the file gives the height of a person
  bool take_file_unit(double height) {
    const double metres = height * *options_.file_unit;
    if (metres < kMinHeight || metres > kMaxHeight) {
      out_.reasons.push_back(fmt::format("The file says that its unit is {:g} m; the person would be {:.4g} m high.",
                                         *options_.file_unit, metres));
      return false;
    }
    set_unit({"", *options_.file_unit, 1.0}, height);
    out_.reasons.push_back(
        fmt::format("Unit: {}, as the file says; the person is {:.2f} m high.", out_.unit, out_.height));
    return true;
  }

  void take_unit(double height) {
    const LengthUnit unit = parse_unit(options_.unit);
    set_unit(unit, height);
    out_.unit_confidence = 1.0;
    if (out_.height < kMinGivenHeight || out_.height > kMaxGivenHeight)
      fail<UsageError>(
          "finding the unit of the scan: with --unit {} the person is {:.4g} m high, {} to {} m are allowed; give "
          "another "
          "--unit, or --up if {} is not up",
          options_.unit, out_.height, kMinGivenHeight, kMaxGivenHeight, out_.up);
    out_.reasons.push_back(fmt::format("Unit: {}, as given; the person is {:.2f} m high.", out_.unit, out_.height));
  }

  void set_unit(const LengthUnit& unit, double height) {
    out_.metres_per_unit = unit.metres;
    out_.unit = *unit.name != '\0' ? std::string(unit.name) : fmt::format("{} m", unit.metres);
    out_.height = height * unit.metres;
  }

  void find_way() {
    if (facing_) {
      out_.facing = facing_->direction;
      out_.reasons.push_back(fmt::format(
          "Facing: ({:.2f}, {:.2f}, {:.2f}) in the file, because the toes point there; {:.0f} % of the body agree with "
          "its mirror image.",
          facing_->direction.x(), facing_->direction.y(), facing_->direction.z(), 100.0 * facing_->mirror));
    } else {
      out_.reasons.emplace_back("Facing: unknown, because no toes point out of the ankles.");
    }
    const Vector3d front = facing_ && options_.face_z ? facing_->direction : usual_front();
    Matrix3d turn;
    turn.row(0) = up().cross(front);
    turn.row(1) = up();
    turn.row(2) = front;
    const double a = body_.box.min().dot(up()), b = body_.box.max().dot(up());
    const Vector3d foot = centre_ + (std::min(a, b) - centre_.dot(up())) * up();
    out_.character_from_file.topLeftCorner<3, 3>() = out_.metres_per_unit * turn;
    out_.character_from_file.topRightCorner<3, 1>() = -out_.metres_per_unit * (turn * foot);
  }

  /// Where files with this up axis have the front: +z for y up, -y for z up.
  Vector3d usual_front() const {
    if (up_ / 2 != 2) return Vector3d::UnitZ();
    return up_ == 4 ? Vector3d(-Vector3d::UnitY()) : Vector3d(Vector3d::UnitY());
  }

  OrientationOptions options_;
  CoarseBody body_;
  int up_ = 2;
  Vector3d centre_ = Vector3d::Zero(), longest_ = Vector3d::UnitY();
  double elongation_ = 0.0;
  std::optional<Facing> facing_;
  ScanOrientation out_;
};

}  // namespace

ScanOrientation find_orientation(const TriangleMesh& mesh, const OrientationOptions& options) {
  check_scan_mesh(mesh, "finding the orientation of the scan");
  if (!options.unit.empty()) parse_unit(options.unit);  // before any work
  if (!options.up.empty()) parse_up(options.up);
  refuse_flat(mesh);
  return OrientationFinder(mesh, options).run();
}

TriangleMesh transformed(const TriangleMesh& mesh, const Matrix4d& target_from_source) {
  TriangleMesh out = mesh;
  const Matrix3d turn = target_from_source.topLeftCorner<3, 3>();
  const Vector3d shift = target_from_source.topRightCorner<3, 1>();
  for (Vector3d& v : out.vertices) v = turn * v + shift;
  if (turn.determinant() < 0.0) {
    for (Triangle& face : out.faces) std::swap(face[1], face[2]);
    for (Triangle& face : out.face_uvs) std::swap(face[1], face[2]);
  }
  return out;
}

}  // namespace doppel
