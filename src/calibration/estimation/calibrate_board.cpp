#include "doppel/calibration/estimation/calibrate_board.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "doppel/calibration/estimation/camera_jacobian.h"
#include "doppel/calibration/estimation/reprojection.h"
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
constexpr double kShareThatAgrees = 0.8, kMaxDisagreement = 6.0;  // of the corners; pixels of an image 1024 wide

/// A rigid motion x -> R x + t.
struct Rigid {
  Matrix3d R = Matrix3d::Identity();
  Vector3d t = Vector3d::Zero();

  Rigid operator*(const Rigid& other) const { return {R * other.R, R * other.t + t}; }
  Rigid inverse() const { return {R.transpose(), -(R.transpose() * t)}; }
};

struct CvView {
  long instant = 0;
  std::vector<cv::Point3f> board;
  std::vector<cv::Point2f> image;
};

/// Where the board lies in the image: middle, size and perspective, as shares of the image.
Eigen::Matrix<double, 5, 1> features_of(const CvView& view, int width, int height) {
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
std::vector<CvView> different_views(std::vector<CvView> views, int width, int height, std::size_t most) {
  if (views.size() <= most) return views;
  std::vector<double> apart(views.size(), std::numeric_limits<double>::infinity());
  std::vector<CvView> chosen;
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

std::vector<CvView> views_of(const BoardSightings& sightings, const Board& board) {
  std::vector<CvView> views;
  for (const auto& [instant, seen] : sightings.views) {
    if (seen.corners.size() < kMinCornersOfView || seen.corners.size() != seen.pixels.size()) continue;
    CvView view{instant, {}, {}};
    for (std::size_t i = 0; i < seen.corners.size(); ++i) {
      const Vector3d corner = board.corner(seen.corners[i]);
      view.board.emplace_back(static_cast<float>(corner.x()), static_cast<float>(corner.y()), 0.0F);
      view.image.emplace_back(static_cast<float>(seen.pixels[i].x()), static_cast<float>(seen.pixels[i].y()));
    }
    views.push_back(std::move(view));
  }
  return views;
}

/// One run of OpenCV's calibration.
struct Fit {
  cv::Mat K, distortion;
  std::vector<double> errors;  ///< root mean square of each view, pixels
  double rms = 0.0, focal_sigma = 0.0;
  double tilt = 0.0;  ///< largest angle between the image and a board, radians
};

double largest_tilt(const std::vector<cv::Mat>& turns) {
  double largest = 0.0;
  for (const cv::Mat& turn : turns) {
    cv::Mat rotation;
    cv::Rodrigues(turn, rotation);
    largest = std::max(largest, std::acos(std::min(1.0, std::abs(rotation.at<double>(2, 2)))));
  }
  return largest;
}

Fit fit_fisheye(const std::vector<std::vector<cv::Point3f>>& board, const std::vector<std::vector<cv::Point2f>>& image,
                const cv::Size& size) {
  std::vector<std::vector<cv::Point3d>> board_points;
  std::vector<std::vector<cv::Point2d>> image_points;
  for (std::size_t v = 0; v < board.size(); ++v) {
    board_points.emplace_back(board[v].begin(), board[v].end());
    image_points.emplace_back(image[v].begin(), image[v].end());
  }
  Fit fit;
  std::vector<cv::Mat> turns, shifts;
  const int flags = cv::fisheye::CALIB_RECOMPUTE_EXTRINSIC | cv::fisheye::CALIB_FIX_SKEW;
  fit.rms = cv::fisheye::calibrate(board_points, image_points, size, fit.K, fit.distortion, turns, shifts, flags);
  fit.tilt = largest_tilt(turns);
  double corners = 0.0;
  for (std::size_t v = 0; v < board.size(); ++v) {
    std::vector<cv::Point2d> projected;
    cv::fisheye::projectPoints(board_points[v], projected, turns[v], shifts[v], fit.K, fit.distortion);
    fit.errors.push_back(cv::norm(projected, image_points[v]) / std::sqrt(static_cast<double>(projected.size())));
    corners += static_cast<double>(projected.size());
  }
  // Of the order of the error of one corner, spread over all corners at a quarter of the image's width.
  fit.focal_sigma = 4.0 * fit.rms * fit.K.at<double>(0, 0) / size.width / std::sqrt(corners);
  return fit;
}

Fit fit_lens(const std::vector<CvView>& views, const cv::Size& size, Lens lens) {
  std::vector<std::vector<cv::Point3f>> board;
  std::vector<std::vector<cv::Point2f>> image;
  for (const CvView& view : views) {
    board.push_back(view.board);
    image.push_back(view.image);
  }
  if (lens == Lens::fisheye) return fit_fisheye(board, image, size);
  Fit fit;
  std::vector<cv::Mat> turns, shifts;
  cv::Mat sigmas, pose_sigmas, errors;
  // k3 is left at 0: a few views of a flat board do not determine it, and it then bends the corners of the image.
  fit.rms = cv::calibrateCamera(board, image, size, fit.K, fit.distortion, turns, shifts, sigmas, pose_sigmas, errors,
                                cv::CALIB_FIX_K3);
  fit.focal_sigma = sigmas.at<double>(0);
  fit.tilt = largest_tilt(turns);
  for (int v = 0; v < errors.rows; ++v) fit.errors.push_back(errors.at<double>(v));
  return fit;
}

/// Removes the views that are far worse than the others. @return whether any was
bool drop_worst(std::vector<CvView>& views, const Fit& fit, std::size_t fewest) {
  const double limit = std::max(kWorstPixels, kWorstOfMedian * quantile(fit.errors, 0.5));
  std::vector<CvView> kept;
  for (std::size_t v = 0; v < views.size(); ++v)
    if (fit.errors[v] <= limit) kept.push_back(views[v]);
  if (kept.size() == views.size() || kept.size() < fewest) return false;
  views = std::move(kept);
  return true;
}

Camera camera_of(const Fit& fit, const BoardSightings& sightings, Lens lens) {
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

void add_notes_of_poses(BoardCalibration& result) {
  for (const BoardCamera& camera : result.cameras)
    if (!camera.posed)
      result.notes.push_back(
          fmt::format("camera {}: no other camera saw the board at the same instants, so its pose is unknown",
                      camera.intrinsics.camera.name));
}

}  // namespace

CameraIntrinsics calibrate_intrinsics(const BoardSightings& sightings, const Board& board,
                                      const BoardCalibrationOptions& options) {
  if (options.lens == Lens::polynomial)
    fail<UsageError>("calibrating camera {}: boards calibrate the lenses opencv and fisheye", sightings.camera);
  std::vector<CvView> views = views_of(sightings, board);
  if (views.size() < std::max<std::size_t>(3, options.fewest_views))
    fail(
        "calibrating camera {}: the board {} was found in {} images, at least {} are needed; show the whole board, "
        "flat "
        "and in focus, or check its numbers of corners",
        sightings.camera, board.to_string(), views.size(), std::max<std::size_t>(3, options.fewest_views));
  views = different_views(std::move(views), sightings.width, sightings.height, options.most_views);
  CameraIntrinsics result;
  double tilt = 0.0;
  try {
    Fit fit = fit_lens(views, {sightings.width, sightings.height}, options.lens);
    if (drop_worst(views, fit, options.fewest_views))
      fit = fit_lens(views, {sightings.width, sightings.height}, options.lens);
    tilt = fit.tilt;
    result = {camera_of(fit, sightings, options.lens), fit.rms, fit.focal_sigma, views.size()};
  } catch (const cv::Exception& error) {
    fail(
        "calibrating camera {}: OpenCV finds no solution from {} views of the board ({}); show the board from other "
        "sides",
        sightings.camera, views.size(), error.err);
  }
  const double focal = result.camera.K(0, 0);
  const std::vector<std::string> faults = result.camera.faults();
  if (!faults.empty() || !(tilt >= kMinTilt) || !(result.focal_sigma <= kUncertainFocal * focal))
    fail(
        "calibrating camera {}: the focal length stays uncertain ({:.0f} +- {:.0f} pixels); the board must be seen at "
        "different angles, not only face to face",
        sightings.camera, focal, result.focal_sigma);
  return result;
}

BoardCalibration calibrate_boards(const std::vector<BoardSightings>& sightings, const Board& board,
                                  const BoardCalibrationOptions& options) {
  if (sightings.empty()) fail("calibrating by a board: no camera was given");
  BoardCalibration result;
  std::vector<Poses> poses;
  for (const BoardSightings& seen : sightings) {
    BoardCamera camera;
    camera.intrinsics = calibrate_intrinsics(seen, board, options);
    Poses of_camera;
    for (const auto& [instant, view] : seen.views)
      if (const auto pose = board_pose(camera.intrinsics.camera, board, view)) of_camera[instant] = *pose;
    poses.push_back(std::move(of_camera));
    result.cameras.push_back(std::move(camera));
  }
  for (std::size_t a = 0; a < poses.size(); ++a) {
    std::set<long> shared;
    for (std::size_t b = 0; b < poses.size(); ++b)
      for (const auto& [instant, pose] : poses[a])
        if (a != b && poses[b].count(instant) > 0) shared.insert(instant);
    result.cameras[a].shared = shared.size();
  }
  if (board.kind == Board::Kind::chessboard && (board.columns + board.rows) % 2 == 0 && sightings.size() > 1)
    result.notes.push_back(
        "the chessboard looks the same upside down, so cameras may see its corners in different order; for poses, use "
        "a board whose numbers of inner corners are one even and one odd, or a ChArUco board");
  BoardRig rig(sightings, board, poses, result);
  if (!rig.empty()) {
    rig.adjust();
    if (rig.agrees()) {
      rig.stand_up(options.floor);
      rig.report();
      add_notes_of_poses(result);
    } else {
      result.notes.emplace_back(
          "no poses: images of the same number show the board at different positions, so they were not taken at the "
          "same "
          "instants");
    }
  } else if (sightings.size() > 1) {
    result.notes.emplace_back("no poses: no two cameras saw the board at the same instants");
  }
  return result;
}

}  // namespace doppel
