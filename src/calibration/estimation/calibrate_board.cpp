#include "doppel/calibration/estimation/calibrate_board.h"

#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "doppel/calibration/estimation/camera_jacobian.h"
#include "doppel/calibration/estimation/fit_lens.h"
#include "doppel/calibration/estimation/reprojection.h"
#include "doppel/core/angles.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/statistics.h"
#include "doppel/geometry/best_rotation.h"
#include "doppel/solver/block_system.h"
#include "doppel/solver/least_squares.h"

namespace doppel {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::size_t kMinCornersOfView = 6;
constexpr double kWorstOfMedian = 3.0;    // times the median error of all views: such a view is left out
constexpr double kWorstPixels = 0.5;      // views below are never left out
constexpr double kUncertainFocal = 0.05;  // relative standard deviation
constexpr double kMinTilt = 0.14;         // radians between the image and the board, in the view with the largest
constexpr double kBoardKernel = 3.0;      // pixels of an image 1024 wide
constexpr std::size_t kMinSharedViews = 1;
constexpr double kBadFit = 3.0;        // pixels of an image 1024 wide; the middle view of a wrong board is far worse
constexpr double kExtrapolated = 1.5;  // times the angle of the farthest corner; the image should not reach beyond
constexpr double kMaxRoll = 20.0 * kRadiansPerDegree;  // of a camera about its axis, against the others
constexpr double kMinLevel = 0.2;  // sine of the angle between a camera's axis and up, where its roll is known
constexpr double kShareThatAgrees = 0.8, kMaxDisagreement = 6.0;  // of the corners; pixels of an image 1024 wide

/// A rigid motion x -> R x + t.
struct Rigid {
  Matrix3d R = Matrix3d::Identity();
  Vector3d t = Vector3d::Zero();

  Rigid operator*(const Rigid& other) const { return {R * other.R, R * other.t + t}; }
  Rigid inverse() const { return {R.transpose(), -(R.transpose() * t)}; }
};

/// Where the board lies in the image: middle, size and perspective, as shares of the image.
Eigen::Matrix<double, 5, 1> features_of(const LensView& view, int width, int height) {
  const cv::RotatedRect box = cv::minAreaRect(view.image);
  Eigen::Matrix<double, 5, 1> features;
  const double angle = box.angle * CV_PI / 180.0;
  features << box.center.x / width, box.center.y / height,
      std::sqrt(box.size.area() / (width * static_cast<double>(height))),
      0.3 * std::min(box.size.width, box.size.height) / std::max(1.0F, std::max(box.size.width, box.size.height)),
      0.1 * std::sin(2.0 * angle);
  return features;
}

/// At most `most` views, those whose positions differ most.
std::vector<LensView> different_views(std::vector<LensView> views, int width, int height, std::size_t most) {
  if (views.size() <= most) return views;
  std::vector<double> apart(views.size(), std::numeric_limits<double>::infinity());
  std::vector<LensView> chosen;
  std::size_t next = 0;
  while (chosen.size() < most) {
    chosen.push_back(views[next]);
    const auto features = features_of(views[next], width, height);
    for (std::size_t i = 0; i < views.size(); ++i)
      apart[i] = std::min(apart[i], (features_of(views[i], width, height) - features).norm());
    next = as_size(std::max_element(apart.begin(), apart.end()) - apart.begin());
  }
  return chosen;
}

std::vector<LensView> views_of(const BoardSightings& sightings, const Board& board) {
  std::vector<LensView> views;
  for (const auto& [instant, seen] : sightings.views) {
    if (seen.corners.size() < kMinCornersOfView || seen.corners.size() != seen.pixels.size()) continue;
    LensView view{instant, {}, {}};
    for (std::size_t i = 0; i < seen.corners.size(); ++i) {
      const Vector3d corner = board.corner(seen.corners[i]);
      view.board.emplace_back(static_cast<float>(corner.x()), static_cast<float>(corner.y()), 0.0F);
      view.image.emplace_back(static_cast<float>(seen.pixels[i].x()), static_cast<float>(seen.pixels[i].y()));
    }
    views.push_back(std::move(view));
  }
  return views;
}

/// Removes the views that are far worse than the others. @return whether any was
bool drop_worst(std::vector<LensView>& views, const LensFit& fit, std::size_t fewest) {
  const double limit = std::max(kWorstPixels, kWorstOfMedian * quantile(fit.errors, 0.5));
  std::vector<LensView> kept;
  for (std::size_t v = 0; v < views.size(); ++v)
    if (fit.errors[v] <= limit) kept.push_back(views[v]);
  if (kept.size() == views.size() || kept.size() < fewest) return false;
  views = std::move(kept);
  return true;
}

Camera camera_of(const LensFit& fit, const BoardSightings& sightings, Lens lens) {
  Camera camera;
  camera.name = sightings.camera;
  camera.width = sightings.width;
  camera.height = sightings.height;
  camera.lens = lens;
  cv::cv2eigen(fit.K, camera.K);
  for (std::size_t i = 0; i < std::min<std::size_t>(fit.distortion.total(), lens == Lens::fisheye ? 4 : 5); ++i)
    camera.distortion[i] = fit.distortion.at<double>(static_cast<int>(i));
  return camera;
}

/// The pose of the board in a camera's axes. Nothing when the corners are too few or nonsense.
std::optional<Rigid> board_pose(const Camera& camera, const Board& board, const BoardView& view) {
  std::vector<cv::Point3d> corners;
  std::vector<cv::Point2d> plane;
  for (std::size_t i = 0; i < view.corners.size(); ++i) {
    const auto seen = sight_of(camera, view.pixels[i]);
    if (!seen) continue;
    const Vector3d corner = board.corner(view.corners[i]);
    corners.emplace_back(corner.x(), corner.y(), 0.0);
    plane.emplace_back(seen->plane.x(), seen->plane.y());
  }
  if (corners.size() < kMinCornersOfView) return std::nullopt;
  cv::Mat turn, shift;
  const cv::Mat unit = cv::Mat::eye(3, 3, CV_64F);
  if (!cv::solvePnP(corners, plane, unit, {}, turn, shift, false, cv::SOLVEPNP_IPPE)) return std::nullopt;
  cv::solvePnPRefineLM(corners, plane, unit, {}, turn, shift);
  Rigid pose;
  cv::Mat rotation;
  cv::Rodrigues(turn, rotation);
  cv::cv2eigen(rotation, pose.R);
  pose.t = Vector3d(shift.at<double>(0), shift.at<double>(1), shift.at<double>(2));
  if (!pose.R.allFinite() || !pose.t.allFinite() || !(pose.t.z() > 0.0)) return std::nullopt;
  return pose;
}

using Poses = std::map<long, Rigid>;  ///< of the board in one camera's axes, by instant

/// Of the motions from camera a to camera b that shared instants propose, the one nearest to all others.
Rigid middle_motion(const Poses& in_a, const Poses& in_b) {
  std::vector<Rigid> proposals;
  for (const auto& [instant, pose] : in_a)
    if (in_b.count(instant) > 0) proposals.push_back(in_b.at(instant) * pose.inverse());
  const Rigid* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const Rigid& one : proposals) {
    double sum = 0.0;
    for (const Rigid& other : proposals)
      sum += Eigen::AngleAxisd(one.R * other.R.transpose()).angle() +
             (one.inverse().t - other.inverse().t).norm() / (0.1 + one.t.norm());
    if (sum >= least) continue;
    least = sum;
    best = &one;
  }
  return *best;
}

std::size_t shared_instants(const Poses& a, const Poses& b) {
  return as_size(std::count_if(a.begin(), a.end(), [&](const auto& entry) { return b.count(entry.first) > 0; }));
}

/// Adds cameras one after the other, always over the pair with the most shared views.
/// @return [C] camera from world, nothing for cameras that no boards connect
std::vector<std::optional<Rigid>> chained_poses(const std::vector<Poses>& poses) {
  std::vector<std::optional<Rigid>> placed(poses.size());
  std::size_t most_views = 0, root = 0;
  for (std::size_t a = 0; a < poses.size(); ++a)
    for (std::size_t b = 0; b < poses.size(); ++b) {
      const std::size_t shared = a == b ? 0 : shared_instants(poses[a], poses[b]);
      if (shared <= most_views) continue;
      most_views = shared;
      root = a;
    }
  if (most_views < kMinSharedViews) return placed;
  placed[root] = Rigid{};
  while (true) {
    std::size_t best = 0, from = 0, to = 0;
    for (std::size_t a = 0; a < poses.size(); ++a)
      for (std::size_t b = 0; b < poses.size(); ++b) {
        if (!placed[a] || placed[b] || shared_instants(poses[a], poses[b]) <= best) continue;
        best = shared_instants(poses[a], poses[b]);
        from = a;
        to = b;
      }
    if (best < kMinSharedViews) return placed;
    placed[to] = middle_motion(poses[from], poses[to]) * *placed[from];
  }
}

/// Cameras and boards together. The state holds six numbers per camera and per board: turn and shift. The first posed
/// camera stays where it is.
class BoardProblem : public LeastSquaresProblem {
 public:
  struct Seen {
    int camera, board;
    Vector3d corner;
    Vector2d pixel;
  };

  BoardProblem(std::vector<Camera> cameras, std::vector<Rigid> boards, std::vector<Seen> seen)
      : cameras_(std::move(cameras)), boards_(std::move(boards)), seen_(std::move(seen)) {}

  Eigen::VectorXd start() const {
    return Eigen::VectorXd::Zero(kBlockSize * static_cast<Eigen::Index>(cameras_.size() + boards_.size()));
  }
  Camera camera(const Eigen::VectorXd& state, int c) const {
    return c == 0 ? cameras_[0]
                  : moved_by(cameras_[c], state.segment<3>(kBlockSize * c), state.segment<3>(kBlockSize * c + 3));
  }
  /// World from board.
  Rigid board(const Eigen::VectorXd& state, int b) const {
    const Eigen::Index at = kBlockSize * (static_cast<Eigen::Index>(cameras_.size()) + b);
    const Rigid& old = boards_[b];
    return {rotation_of(state.segment<3>(at)) * old.R, old.t + state.segment<3>(at + 3)};
  }

  double cost(const Eigen::VectorXd& state) override {
    fill(state, false);
    return cost_ = rows_.cost();
  }
  double linearise(const Eigen::VectorXd& state) override {
    fill(state, true);
    cost_ = rows_.cost();
    system_.reset(state.size());
    system_.add(rows_);
    return cost_;
  }
  bool solve(double damping, Eigen::VectorXd& step) override { return system_.solve(damping, step); }
  Eigen::VectorXd moved(const Eigen::VectorXd& state, const Eigen::VectorXd& step) const override {
    Eigen::VectorXd result = state + step;
    for (Eigen::Index at = 0; at < state.size(); at += kBlockSize)
      result.segment<3>(at) = turn_of(rotation_of(step.segment<3>(at)) * rotation_of(state.segment<3>(at)));
    return result;
  }
  std::vector<TermCost> term_costs() const override { return {{"corners", cost_}}; }

 private:
  void fill(const Eigen::VectorXd& state, bool jacobian) {
    std::vector<Camera> cameras;
    std::vector<Rigid> boards;
    for (std::size_t c = 0; c < cameras_.size(); ++c) cameras.push_back(camera(state, static_cast<int>(c)));
    for (std::size_t b = 0; b < boards_.size(); ++b) boards.push_back(board(state, static_cast<int>(b)));
    rows_.reset(static_cast<int>(state.size()), 2, RobustKernel::geman_mcclure_of(kBoardKernel), jacobian);
    for (const Seen& seen : seen_) {
      const Camera& in = cameras[seen.camera];
      const Vector3d turned = boards[seen.board].R * seen.corner;
      const auto found = camera_jacobian(in, turned + boards[seen.board].t);
      const Eigen::Index first = rows_.add_group(1.0);
      const double unit = rig_reference_pixels(in);
      for (Eigen::Index i = 0; i < 2; ++i) {
        rows_.value(first + i) = found ? unit * (found->pixel - seen.pixel)[i] : kRigReferenceWidth;
        if (!jacobian || !found) continue;
        auto row = rows_.jacobian(first + i);
        if (seen.camera > 0) {
          row.block(seen.camera).head<3>() = unit * found->by_turn.row(i).transpose();
          row.block(seen.camera).tail<3>() = -unit * found->by_point.row(i).transpose();
        }
        Block& of_board = row.block(static_cast<int>(cameras_.size()) + seen.board);
        of_board.head<3>() = -unit * (found->by_point.row(i) * cross_matrix(turned)).transpose();
        of_board.tail<3>() = unit * found->by_point.row(i).transpose();
      }
    }
  }

  std::vector<Camera> cameras_;
  std::vector<Rigid> boards_;
  std::vector<Seen> seen_;
  BlockResiduals rows_;
  BlockSystem system_{{400, 1e-8}};
  double cost_ = 0.0;
};

/// The posed cameras and the boards of the instants that two of them saw, adjusted together.
class BoardRig {
 public:
  BoardRig(const std::vector<BoardSightings>& sightings, const Board& board, const std::vector<Poses>& poses,
           BoardCalibration& result)
      : sightings_(sightings), board_(board), result_(result) {
    const std::vector<std::optional<Rigid>> placed = chained_poses(poses);
    for (std::size_t c = 0; c < placed.size(); ++c) {
      if (!placed[c]) continue;
      Camera camera = result.cameras[c].intrinsics.camera;
      camera.R = placed[c]->R;
      camera.t = placed[c]->t;
      index_.push_back(c);
      cameras_.push_back(camera);
    }
    for (std::size_t i = 0; i < index_.size(); ++i)
      for (const auto& [instant, pose] : poses[index_[i]]) {
        if (instants_.count(instant) == 0) {
          instants_[instant] = static_cast<int>(boards_.size());
          boards_.push_back(placed[index_[i]]->inverse() * pose);
        }
        add_corners(static_cast<int>(i), instant);
      }
  }

  bool empty() const { return cameras_.empty(); }

  void adjust() {
    BoardProblem problem(cameras_, boards_, seen_);
    Eigen::VectorXd state = problem.start();
    SolverOptions options;
    options.iterations = 60;
    options.function_tolerance = 1e-9;
    minimise(problem, state, options);
    for (std::size_t c = 0; c < cameras_.size(); ++c) cameras_[c] = problem.camera(state, static_cast<int>(c));
    for (std::size_t b = 0; b < boards_.size(); ++b) boards_[b] = problem.board(state, static_cast<int>(b));
  }

  /// Turns the world such that y is up.
  void stand_up(const std::optional<long>& floor) {
    Vector3d up = Vector3d::Zero();
    if (floor) {
      if (instants_.count(*floor) == 0)
        fail<UsageError>(
            "calibrating by a board: no posed camera sees the board at instant {}, where it is said to lie on the "
            "floor",
            *floor);
      up = boards_[instants_.at(*floor)].R.col(2);
      if (up.dot(cameras_[0].centre() - boards_[instants_.at(*floor)].t) < 0.0) up = -up;
    } else {
      for (const Camera& camera : cameras_) up -= camera.R.row(1).transpose();
      if (!(up.norm() > 1e-6)) up = -cameras_[0].R.row(1).transpose();
      note_of_rolled_camera(up.normalized());
    }
    const Matrix3d turn = rotation_between(up.normalized(), Vector3d::UnitY()).toRotationMatrix();
    Vector3d origin = Vector3d::Zero();
    for (const Camera& camera : cameras_) origin += turn * camera.centre() / static_cast<double>(cameras_.size());
    origin.y() = floor ? (turn * boards_[instants_.at(*floor)].t).y() : lowest_corner(turn);
    for (Camera& camera : cameras_) {
      const Vector3d centre = turn * camera.centre() - origin;
      camera.R = camera.R * turn.transpose();
      camera.t = -camera.R * centre;
    }
    for (Rigid& board : boards_) board = {turn * board.R, turn * board.t - origin};
  }

  /// Whether the boards of one number lie at one position for all cameras.
  bool agrees() const {
    std::vector<double> distances;
    for (const BoardProblem::Seen& seen : seen_) {
      const Camera& camera = cameras_[seen.camera];
      const Rigid& board = boards_[seen.board];
      const auto pixel = safe_pixel(camera, board.R * seen.corner + board.t);
      distances.push_back(pixel ? rig_reference_pixels(camera) * (*pixel - seen.pixel).norm() : kRigReferenceWidth);
    }
    return quantile(distances, kShareThatAgrees) <= kMaxDisagreement;
  }

  void report() {
    std::vector<double> squares(cameras_.size(), 0.0), counts(cameras_.size(), 0.0);
    double sum = 0.0;
    for (const BoardProblem::Seen& seen : seen_) {
      const Rigid& board = boards_[seen.board];
      const auto pixel = safe_pixel(cameras_[seen.camera], board.R * seen.corner + board.t);
      if (!pixel) continue;
      squares[seen.camera] += (*pixel - seen.pixel).squaredNorm();
      sum += (*pixel - seen.pixel).squaredNorm();
      counts[seen.camera] += 1.0;
    }
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      BoardCamera& camera = result_.cameras[index_[i]];
      camera.posed = true;
      camera.intrinsics.camera.R = cameras_[i].R;
      camera.intrinsics.camera.t = cameras_[i].t;
      camera.rms = std::sqrt(squares[i] / std::max(1.0, counts[i]));
    }
    result_.rms = std::sqrt(sum / std::max<double>(1.0, static_cast<double>(seen_.size())));
  }

 private:
  void add_corners(int camera, long instant) {
    const BoardView& view = sightings_[index_[camera]].views.at(instant);
    for (std::size_t i = 0; i < view.corners.size(); ++i)
      seen_.push_back({camera, instants_.at(instant), board_.corner(view.corners[i]), view.pixels[i]});
  }

  /// A camera that is mounted on its side turns the mean direction that is up in the images.
  void note_of_rolled_camera(const Vector3d& up) {
    double largest = 0.0;
    std::string name;
    for (const Camera& camera : cameras_) {
      const double right = camera.R.row(0).dot(up), upwards = -camera.R.row(1).dot(up);
      const double roll = std::hypot(right, upwards) < kMinLevel ? 0.0 : std::abs(std::atan2(right, upwards));
      if (roll <= largest) continue;
      largest = roll;
      name = camera.name;
    }
    if (largest > kMaxRoll)
      result_.notes.push_back(fmt::format(
          "up is uncertain: the directions that are up in the images disagree (camera {} is turned by {:.0f} "
          "degrees about its axis against their mean); give --floor, or mend it by `doppel calibrate world`",
          name, largest / kRadiansPerDegree));
  }

  double lowest_corner(const Matrix3d& turn) const {
    double lowest = std::numeric_limits<double>::infinity();
    for (const BoardProblem::Seen& seen : seen_) {
      const Rigid& board = boards_[seen.board];
      lowest = std::min(lowest, (turn * (board.R * seen.corner + board.t)).y());
    }
    return lowest;
  }

  const std::vector<BoardSightings>& sightings_;
  const Board& board_;
  BoardCalibration& result_;
  std::vector<std::size_t> index_;  ///< of the posed cameras among all
  std::vector<Camera> cameras_;
  std::map<long, int> instants_;
  std::vector<Rigid> boards_;  ///< world from board
  std::vector<BoardProblem::Seen> seen_;
};

/// [C] cameras that boards connect, directly or by others, have the same number.
std::vector<std::size_t> groups_of(const std::vector<Poses>& poses) {
  std::vector<std::size_t> groups(poses.size());
  std::iota(groups.begin(), groups.end(), std::size_t{0});
  for (std::size_t a = 0; a < poses.size(); ++a)
    for (std::size_t b = 0; b < a; ++b)
      if (shared_instants(poses[a], poses[b]) >= kMinSharedViews)
        std::replace(groups.begin(), groups.end(), std::size_t{groups[a]}, std::size_t{groups[b]});
  return groups;
}

void add_notes_of_poses(const std::vector<Poses>& poses, BoardCalibration& result) {
  std::vector<std::string> posed;
  std::map<std::size_t, std::vector<std::string>> others;
  const std::vector<std::size_t> groups = groups_of(poses);
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const BoardCamera& camera = result.cameras[c];
    (camera.posed ? posed : others[groups[c]]).push_back(camera.intrinsics.camera.name);
  }
  for (const auto& [group, names] : others) {
    if (names.empty()) continue;
    result.notes.push_back(
        names.size() == 1
            ? fmt::format("camera {}: no other camera saw the board at the same instants, so its pose is unknown",
                          names.front())
            : fmt::format("the cameras {} see the board together, but never with {}, so their poses are unknown; show "
                          "it to both groups at once",
                          fmt::join(names, ", "), fmt::join(posed, ", ")));
  }
}

/// Whether most views are far off, in plain words; empty when they fit.
std::string bad_fit(const LensFit& fit, const BoardSightings& sightings, const Board& board) {
  const double middle = quantile(fit.errors, 0.5);
  if (middle * kRigReferenceWidth / sightings.width <= kBadFit) return "";
  return fmt::format(
      "most views of the board fit badly (the corners of the middle one are {:.1f} pixels off): are the numbers of {} "
      "of the board right, {} x {}?",
      middle, board.kind == Board::Kind::chessboard ? "inner corners" : "squares", board.columns, board.rows);
}

/// What the user should know of a lens, plain sentences.
std::vector<std::string> notes_of_lens(const Camera& camera, const LensFit& fit) {
  std::vector<std::string> notes;
  const double image = angle_of_image_corner(camera);
  if (const auto angle = angle_of_turning_back(camera))
    notes.push_back(
        fmt::format("the lens is wrong beyond {:.0f} degrees from its axis, where it turns back before the corner of "
                    "the image; show the board near the corners of the image",
                    *angle / kRadiansPerDegree));
  else if (camera.lens == Lens::fisheye && image > kExtrapolated * fit.largest_angle)
    notes.push_back(
        fmt::format("the board was seen up to {:.0f} degrees from the axis of the lens, the image reaches to {:.0f}: "
                    "between them, the lens is extrapolated; show the board near the corners of the image",
                    fit.largest_angle / kRadiansPerDegree, image / kRadiansPerDegree));
  return notes;
}

/// @throws Error when the views do not determine the focal length
void check_lens(const CameraIntrinsics& found, const LensFit& fit, const std::string& misfit) {
  const double focal = found.camera.K(0, 0);
  if (found.camera.faults().empty() && fit.tilt >= kMinTilt && found.focal_sigma <= kUncertainFocal * focal) return;
  fail(
      "calibrating camera {}: the focal length stays uncertain ({:.0f} +- {:.0f} pixels); the board must be seen at "
      "different angles, not only face to face{}",
      found.camera.name, focal, found.focal_sigma, misfit.empty() ? "" : "; " + misfit);
}

/// The intrinsics of all cameras that can be calibrated, and the poses of the board in their axes. A note names each
/// camera that is left out.
struct BoardCameras {
  std::vector<BoardSightings> sightings;  ///< of the cameras that are kept
  std::vector<Poses> poses;
};

BoardCameras calibrate_each(const std::vector<BoardSightings>& sightings, const Board& board,
                            const BoardCalibrationOptions& options, BoardCalibration& result) {
  BoardCameras kept;
  std::vector<std::string> failures;
  for (const BoardSightings& seen : sightings) {
    BoardCamera camera;
    try {
      camera.intrinsics = calibrate_intrinsics(seen, board, options);
    } catch (const UsageError&) {
      throw;
    } catch (const Error& error) {
      failures.emplace_back(error.what());
      continue;
    }
    camera.boards = seen.views.size();
    for (const std::string& note : camera.intrinsics.notes)
      result.notes.push_back(fmt::format("camera {}: {}", seen.camera, note));
    Poses of_camera;
    for (const auto& [instant, view] : seen.views)
      if (const auto pose = board_pose(camera.intrinsics.camera, board, view)) of_camera[instant] = *pose;
    kept.sightings.push_back(seen);
    kept.poses.push_back(std::move(of_camera));
    result.cameras.push_back(std::move(camera));
  }
  if (result.cameras.empty()) fail("{}", fmt::join(failures, "; "));
  for (const std::string& failure : failures) result.notes.push_back("a camera is left out: " + failure);
  return kept;
}

void count_shared(const std::vector<Poses>& poses, BoardCalibration& result) {
  for (std::size_t a = 0; a < poses.size(); ++a) {
    std::set<long> shared;
    for (std::size_t b = 0; b < poses.size(); ++b)
      for (const auto& [instant, pose] : poses[a])
        if (a != b && poses[b].count(instant) > 0) shared.insert(instant);
    result.cameras[a].shared = shared.size();
  }
}

}  // namespace

CameraIntrinsics calibrate_intrinsics(const BoardSightings& sightings, const Board& board,
                                      const BoardCalibrationOptions& options) {
  if (options.lens == Lens::polynomial)
    fail<UsageError>("calibrating camera {}: boards calibrate the lenses opencv and fisheye", sightings.camera);
  std::vector<LensView> views = views_of(sightings, board);
  const std::size_t fewest = std::max<std::size_t>(3, options.fewest_views);
  if (views.size() < fewest)
    fail(
        "calibrating camera {}: the board {} was found in {} images, at least {} are needed; show the whole board, "
        "flat and in focus, or check its numbers of corners",
        sightings.camera, board.to_string(), views.size(), fewest);
  views = different_views(std::move(views), sightings.width, sightings.height, options.most_views);
  LensFit fit;
  try {
    fit = fit_lens(views, {sightings.width, sightings.height}, options.lens);
    if (drop_worst(views, fit, options.fewest_views))
      fit = fit_lens(views, {sightings.width, sightings.height}, options.lens);
  } catch (const cv::Exception& error) {
    fail(
        "calibrating camera {}: OpenCV finds no solution from {} views of the board ({}); show the board from other "
        "sides",
        sightings.camera, views.size(), error.err);
  }
  CameraIntrinsics result{camera_of(fit, sightings, options.lens), fit.rms, fit.focal_sigma, views.size(), {}};
  const std::string misfit = bad_fit(fit, sightings, board);
  check_lens(result, fit, misfit);
  result.notes = notes_of_lens(result.camera, fit);
  if (!misfit.empty()) result.notes.push_back(misfit);
  return result;
}

BoardCalibration calibrate_boards(const std::vector<BoardSightings>& sightings, const Board& board,
                                  const BoardCalibrationOptions& options) {
  if (sightings.empty()) fail("calibrating by a board: no camera was given");
  BoardCalibration result;
  const BoardCameras cameras = calibrate_each(sightings, board, options, result);
  count_shared(cameras.poses, result);
  if (board.kind == Board::Kind::chessboard && (board.columns + board.rows) % 2 == 0 && sightings.size() > 1)
    result.notes.push_back(
        "the chessboard looks the same upside down, so cameras may see its corners in different order; for poses, use "
        "a board whose numbers of inner corners are one even and one odd, or a ChArUco board");
  BoardRig rig(cameras.sightings, board, cameras.poses, result);
  if (!rig.empty()) {
    rig.adjust();
    if (rig.agrees()) {
      rig.stand_up(options.floor);
      rig.report();
      add_notes_of_poses(cameras.poses, result);
    } else {
      result.notes.emplace_back(
          "no poses: images of the same number show the board at different positions, so they were not taken at the "
          "same instants");
    }
  } else if (cameras.sightings.size() > 1) {
    result.notes.emplace_back("no poses: no two cameras saw the board at the same instants");
  }
  return result;
}

}  // namespace doppel
