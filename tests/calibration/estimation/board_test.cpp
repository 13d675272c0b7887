#include "doppel/calibration/estimation/board.h"

#include <fmt/ranges.h>
#include <gmock/gmock.h>

#include "calibration/estimation/drawn_board.h"
#include "calibration/estimation/rig_error.h"
#include "doppel/calibration/estimation/calibrate_board.h"
#include "doppel/calibration/estimation/charuco_versions.h"
#include "doppel/calibration/estimation/fit_lens.h"
#include "doppel/core/angles.h"
#include "doppel/core/error.h"
#include "support/message_of.h"
#include "support/ring_of_cameras.h"

namespace doppel {
namespace {

using support::BoardPose;
using support::chessboard_paint;
using support::drawn_board;
using support::facing;
using support::message_of;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

Camera desk_camera() {
  Camera camera;
  camera.name = "desk";
  camera.width = 480;
  camera.height = 360;
  camera.K << 520, 0, 246, 0, 522, 175, 0, 0, 1;
  camera.distortion[0] = -0.12;
  camera.distortion[1] = 0.05;
  return camera;
}

BoardPose desk_pose(int view, const Board& board) {
  const double a = 1.3 * view;
  return facing({0.08 * std::sin(2.1 * a), 0.05 * std::cos(1.7 * a), 0.55 + 0.12 * std::sin(a)}, {0, 0, 0},
                0.45 * std::sin(1.1 * a + 0.5), 0.45 * std::cos(0.9 * a), 0.2 * std::sin(3.0 * a), board);
}

/// Root mean square distance of the corners from where they are.
double corner_error(const BoardView& view, const Board& board, const Camera& camera, const BoardPose& pose) {
  double squares = 0.0;
  for (std::size_t i = 0; i < view.corners.size(); ++i)
    squares += (camera.project(pose.R * board.corner(view.corners[i]) + pose.t) - view.pixels[i]).squaredNorm();
  return std::sqrt(squares / static_cast<double>(view.corners.size()));
}

TEST(Board, ParsesDescriptions) {
  const Board chess = parse_board("chessboard:6x3:60mm");
  EXPECT_EQ(chess.num_corners(), 18);
  EXPECT_DOUBLE_EQ(chess.square, 0.06);
  EXPECT_EQ(chess.to_string(), "chessboard:6x3:60mm");
  const Board charuco = parse_board("charuco:8x5:4cm:0.03m:DICT_4X4_50");
  EXPECT_EQ(charuco.num_corners(), 28);
  EXPECT_DOUBLE_EQ(charuco.marker, 0.03);
  EXPECT_EQ(parse_board(charuco.to_string()).to_string(), charuco.to_string());
  for (const auto& [text, complaint] :
       std::vector<std::pair<std::string, std::string>>{{"", "is no board"},
                                                        {"chessboard:6x3", "is no board"},
                                                        {"chessboard:6:60mm", "columns and rows"},
                                                        {"chessboard:6x3x2:60mm", "columns and rows"},
                                                        {"chessboard:6x3:60", "is no length"},
                                                        {"chessboard:6x3:-60mm", "is no length"},
                                                        {"chessboard:6x2:60mm", "at least 3x3"},
                                                        {"chessboard:99999x3:60mm", "columns and rows"},
                                                        {"charuco:8x5:40mm:50mm:DICT_4X4_50", "not smaller"},
                                                        {"charuco:8x5:40mm:30mm:DICT_9X9", "DICT_4X4_50"}})
    EXPECT_THAT(message_of<UsageError>([&] { parse_board(text); }), HasSubstr(complaint)) << text;
}

TEST(Board, FindsChessboardCornersToAFractionOfAPixel) {
  const Board board = parse_board("chessboard:6x4:40mm");
  const Camera camera = desk_camera();
  for (int view = 0; view < 3; ++view) {
    const BoardPose pose = desk_pose(view, board);
    // 6 + 4 is even: the numbering may be turned by half a turn, which the square's corner order hides.
    const cv::Mat image = drawn_board(camera, pose, chessboard_paint(board), 1);
    auto found = find_board(image, board);
    ASSERT_TRUE(found) << view;
    if (corner_error(*found, board, camera, pose) > 5.0) std::reverse(found->pixels.begin(), found->pixels.end());
    EXPECT_LT(corner_error(*found, board, camera, pose), 0.12) << view;
  }
}

TEST(Board, NumbersAnAsymmetricBoardInOneWay) {
  const Board board = parse_board("chessboard:5x4:40mm");
  const Camera camera = desk_camera();
  for (const double roll : {0.0, 3.0, 1.5}) {
    const BoardPose pose = facing({0.02, 0.01, 0.6}, {0, 0, 0}, 0.2, -0.3, roll, board);
    const auto found = find_board(drawn_board(camera, pose, chessboard_paint(board), 2), board);
    ASSERT_TRUE(found) << roll;
    EXPECT_LT(corner_error(*found, board, camera, pose), 0.12) << roll;
  }
}

TEST(Board, ACharucoBoardHasABlackSquareAtTheUpperLeft) {
  for (const int rows : {5, 6}) {
    const cv::Mat paper =
        draw_charuco(charuco_board(8, rows, 0.04, 0.03, aruco_dictionary(cv::aruco::DICT_4X4_50)), {800, 100 * rows});
    EXPECT_EQ(cv::mean(paper(cv::Rect(5, 5, 90, 90)))[0], 0.0) << rows;
  }
}

TEST(Board, FindsACharucoBoardThatIsCutOff) {
  const Board board = parse_board("charuco:6x5:40mm:30mm:DICT_4X4_50");
  const auto drawing = charuco_board(6, 5, 0.04, 0.03, aruco_dictionary(cv::aruco::DICT_4X4_50));
  constexpr int kPixelsOfSquare = 160;
  const cv::Mat paper = draw_charuco(drawing, {6 * kPixelsOfSquare, 5 * kPixelsOfSquare});
  // OpenCV numbers the corners from the row that its drawing has at the bottom or at the top, depending on its version.
  const auto found_on_paper = find_board(paper, board);
  ASSERT_TRUE(found_on_paper);
  const bool upwards = found_on_paper->pixels.front().y() > found_on_paper->pixels.back().y();
  const support::BoardPaint paint = [&](double x, double y) {
    const double across = x / 0.04, down = upwards ? 5.0 - y / 0.04 : y / 0.04;
    const int column = static_cast<int>(std::floor(across * kPixelsOfSquare));
    const int row = static_cast<int>(std::floor(down * kPixelsOfSquare));
    if (across < -0.3 || across > 6.3 || down < -0.3 || down > 5.3) return -1.0;
    const bool inside = column >= 0 && column < paper.cols && row >= 0 && row < paper.rows;
    return inside ? 20.0 + 0.82 * paper.at<unsigned char>(row, column) : 230.0;
  };
  // The board's corners count from the first inner corner, the paper from its edge.
  Board shifted = board;
  const Camera camera = desk_camera();
  BoardPose pose = facing({0.2, 0.0, 0.5}, {0, 0, 0}, 0.2, 0.3, 0.1, board);
  if (upwards) pose.R.rightCols<2>() *= -1.0;
  if (upwards) pose.t = Eigen::Vector3d(0.2, 0.0, 0.5) - pose.R * Eigen::Vector3d(0.12, 0.1, 0.0);
  const auto found = find_board(drawn_board(camera, pose, paint, 3), board);
  ASSERT_TRUE(found);
  EXPECT_LT(found->corners.size(), 20U);
  BoardPose of_corners = pose;
  of_corners.t += pose.R * Eigen::Vector3d(0.04, 0.04, 0.0);
  EXPECT_LT(corner_error(*found, shifted, camera, of_corners), 0.15);
}

/// A board as OpenCV before 4.6 drew it: markers row by row from the square at the upper left, which is white.
cv::Mat old_charuco(int columns, int rows) {
  constexpr int kSquare = 100, kMarker = 75, kMargin = (kSquare - kMarker) / 2;
  const auto dictionary = aruco_dictionary(cv::aruco::DICT_4X4_50);
  cv::Mat paper(rows * kSquare, columns * kSquare, CV_8U, cv::Scalar(255));
  int marker = 0;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const cv::Rect square(c * kSquare, r * kSquare, kSquare, kSquare);
      if ((r + c) % 2 == 1) {
        paper(square).setTo(0);
        continue;
      }
      draw_marker(dictionary, marker++, kMarker)
          .copyTo(paper(cv::Rect(square.x + kMargin, square.y + kMargin, kMarker, kMarker)));
    }
  return paper;
}

TEST(Board, ReadsBoardsThatWereDrawnBeforeOpenCv46) {
  for (const int columns : {5, 6}) {
    const Board board = parse_board("charuco:" + std::to_string(columns) + "x4:40mm:30mm:DICT_4X4_50");
    cv::Mat paper;
    cv::copyMakeBorder(old_charuco(columns, 4), paper, 50, 50, 50, 50, cv::BORDER_CONSTANT, cv::Scalar(255));
    const auto found = find_board(paper, board);
    ASSERT_TRUE(found) << columns;
    EXPECT_EQ(found->corners.size(), static_cast<std::size_t>(board.num_corners()));
    for (std::size_t i = 0; i < found->corners.size(); ++i) {
      const Eigen::Vector3d corner = board.corner(found->corners[i]) / 0.04;
      const Eigen::Vector2d expected(150.0 + 100.0 * corner.x(), 150.0 + 100.0 * corner.y());
      EXPECT_LT((found->pixels[i] - expected).norm(), 0.2) << found->corners[i];
    }
  }
}

TEST(Board, FindsNothingInAnEmptyImage) {
  const cv::Mat noise(200, 300, CV_8UC3, cv::Scalar(90, 120, 80));
  EXPECT_FALSE(find_board(noise, parse_board("chessboard:6x3:60mm")));
  EXPECT_FALSE(find_board(noise, parse_board("charuco:8x5:40mm:30mm:DICT_4X4_50")));
  EXPECT_THAT(message_of<Error>([] { find_board(cv::Mat(), parse_board("chessboard:6x3:60mm")); }), HasSubstr("8 bit"));
}

TEST(CalibrateBoard, FindsIntrinsicsFromDrawings) {
  const Board board = parse_board("chessboard:5x4:40mm");
  const Camera camera = desk_camera();
  BoardSightings seen{"desk", camera.width, camera.height, {}};
  for (int view = 0; view < 9; ++view)
    if (const auto found = find_board(drawn_board(camera, desk_pose(view, board), chessboard_paint(board), 4), board))
      seen.views[view] = *found;
  ASSERT_GE(seen.views.size(), 7U);
  const CameraIntrinsics found = calibrate_intrinsics(seen, board);
  EXPECT_LT(found.rms, 0.1);
  EXPECT_NEAR(found.camera.K(0, 0) / camera.K(0, 0), 1.0, 0.005);
  EXPECT_NEAR(found.camera.K(1, 1) / camera.K(1, 1), 1.0, 0.005);
  EXPECT_NEAR(found.camera.K(0, 2), camera.K(0, 2), 2.0);
  EXPECT_NEAR(found.camera.K(1, 2), camera.K(1, 2), 2.0);
  EXPECT_NEAR(found.camera.distortion[0], camera.distortion[0], 0.03);
}

/// What cameras see of a board, with noise on the corners and some corners missing.
BoardSightings sightings(const Camera& camera, const Board& board, const std::vector<BoardPose>& poses, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 0.15);
  BoardSightings seen{camera.name, camera.width, camera.height, {}};
  for (std::size_t v = 0; v < poses.size(); ++v) {
    BoardView view;
    for (int i = 0; i < board.num_corners(); ++i) {
      const Eigen::Vector3d corner = poses[v].R * board.corner(i) + poses[v].t;
      const Eigen::Vector3d in_camera = camera.camera_from_world(corner);
      const Eigen::Vector2d pixel = camera.project(corner);
      const bool inside =
          in_camera.z() > 0.1 && pixel.minCoeff() > 0.0 && pixel.x() < camera.width && pixel.y() < camera.height;
      const bool from_front = camera.R.row(2).dot(poses[v].R.col(2)) > 0.35;
      if (!inside || !from_front) continue;
      view.corners.push_back(i);
      view.pixels.push_back(pixel + Eigen::Vector2d(noise(random), noise(random)));
    }
    if (static_cast<int>(view.corners.size()) == board.num_corners()) seen.views[static_cast<long>(v)] = view;
  }
  return seen;
}

TEST(CalibrateBoard, RigThatNoBoardShowsAtOnce) {
  const Board board = parse_board("charuco:9x6:100mm:75mm:DICT_5X5_100");
  std::vector<Camera> ground_truth;
  for (Camera camera : ring_of_cameras(6, 800, {0, 1.0, 0})) {
    camera.distortion[0] = -0.08;
    ground_truth.push_back(camera);
  }
  std::vector<BoardPose> poses;
  for (int i = 0; i < 90; ++i) {
    const double angle = 0.21 * i;
    const Eigen::Vector3d at(0.4 * std::sin(1.7 * i), 1.0 + 0.3 * std::sin(0.9 * i), 0.4 * std::cos(1.3 * i));
    poses.push_back(facing(at, at + Eigen::Vector3d(std::sin(angle), 0.1, std::cos(angle)), 0.5 * std::sin(2.0 * i),
                           0.5 * std::cos(1.1 * i), 0.3 * std::sin(i), board));
  }
  std::vector<BoardSightings> seen;
  for (std::size_t c = 0; c < ground_truth.size(); ++c)
    seen.push_back(sightings(ground_truth[c], board, poses, static_cast<unsigned>(c)));
  const BoardCalibration found = calibrate_boards(seen, board);
  EXPECT_LT(found.rms, 0.3);
  std::vector<Camera> cameras;
  for (const BoardCamera& camera : found.cameras) {
    ASSERT_TRUE(camera.posed);
    cameras.push_back(camera.intrinsics.camera);
  }
  const support::RigError error = support::error_of(cameras, ground_truth);
  // Each camera sees some twenty boards: its principal point is 3 pixels off, which a turn of 0.2 degrees makes up for.
  EXPECT_LT(error.degrees, 0.3);
  EXPECT_LT(error.metres, 0.005);
  for (std::size_t c = 0; c < ground_truth.size(); ++c)
    EXPECT_NEAR(cameras[c].K(0, 0) / ground_truth[c].K(0, 0), 1.0, 0.004);
  // The board gives the scale.
  EXPECT_NEAR((cameras[0].centre() - cameras[3].centre()).norm(),
              (ground_truth[0].centre() - ground_truth[3].centre()).norm(), 0.02);
  EXPECT_GT(cameras[0].centre().y(), 0.0);
}

/// What a rig before a board sees; the cameras stand side by side and look along +z.
std::vector<BoardSightings> row_of_cameras(std::size_t count, const Board& board, int views) {
  std::vector<BoardPose> poses;
  for (int view = 0; view < views; ++view) poses.push_back(desk_pose(view, board));
  std::vector<BoardSightings> seen;
  for (std::size_t c = 0; c < count; ++c) {
    Camera camera = desk_camera();
    camera.name = fmt::format("c{}", c);
    camera.t.x() = 0.02 - 0.02 * static_cast<double>(c);
    seen.push_back(sightings(camera, board, poses, static_cast<unsigned>(c)));
  }
  return seen;
}

TEST(CalibrateBoard, LeavesOutACameraThatSawTooLittle) {
  const Board board = parse_board("chessboard:7x4:40mm");
  std::vector<BoardSightings> seen = row_of_cameras(3, board, 12);
  seen[2].views.clear();
  const BoardCalibration found = calibrate_boards(seen, board);
  ASSERT_EQ(found.cameras.size(), 2U);
  EXPECT_TRUE(found.cameras[1].posed);
  EXPECT_THAT(found.notes, Contains(HasSubstr("a camera is left out: calibrating camera c2")));
  for (BoardSightings& camera : seen) camera.views.clear();
  EXPECT_THAT(message_of<Error>([&] { calibrate_boards(seen, board); }),
              AllOf(HasSubstr("camera c0"), HasSubstr("camera c2")));
}

TEST(CalibrateBoard, NamesGroupsOfCamerasThatNoBoardConnects) {
  const Board board = parse_board("chessboard:7x4:40mm");
  std::vector<BoardSightings> seen = row_of_cameras(4, board, 14);
  for (const std::size_t c : {2U, 3U}) {
    std::map<long, BoardView> later;
    for (const auto& [instant, view] : seen[c].views)
      if (instant > 0) later[instant + 1000] = view;
    seen[c].views = later;
  }
  const BoardCalibration found = calibrate_boards(seen, board);
  ASSERT_EQ(found.cameras.size(), 4U);
  EXPECT_TRUE(found.cameras[0].posed && found.cameras[1].posed);
  EXPECT_FALSE(found.cameras[2].posed || found.cameras[3].posed);
  EXPECT_THAT(found.notes, Contains(HasSubstr("the cameras c2, c3 see the board together, but never with c0, c1")));
}

/// The same images, of a camera that is mounted on its side: turned by 90 degrees.
BoardSightings on_its_side(BoardSightings seen) {
  for (auto& [instant, view] : seen.views)
    for (Eigen::Vector2d& pixel : view.pixels) pixel = Eigen::Vector2d(pixel.y(), seen.width - pixel.x());
  std::swap(seen.width, seen.height);
  return seen;
}

TEST(CalibrateBoard, SaysThatUpIsUncertainWhenACameraLiesOnItsSide) {
  const Board board = parse_board("chessboard:7x4:40mm");
  std::vector<BoardSightings> seen = row_of_cameras(3, board, 14);
  const auto is_uncertain = Contains(HasSubstr("up is uncertain"));
  EXPECT_THAT(calibrate_boards(seen, board).notes, Not(is_uncertain));
  seen[2] = on_its_side(seen[2]);
  EXPECT_THAT(calibrate_boards(seen, board).notes, Contains(HasSubstr("camera c2 is turned by")));
  BoardCalibrationOptions on_the_floor;
  on_the_floor.floor = seen[0].views.begin()->first;
  EXPECT_THAT(calibrate_boards(seen, board, on_the_floor).notes, Not(is_uncertain));
}

TEST(CalibrateBoard, NamesAWrongNumberOfSquaresWhereMostViewsFitBadly) {
  // Corners that are numbered by a board of another width lie where no board has them.
  const Board filmed = parse_board("charuco:7x5:40mm:30mm:DICT_4X4_50"),
              stated = parse_board("charuco:6x6:40mm:30mm:DICT_4X4_50");
  BoardSightings seen = row_of_cameras(1, filmed, 10)[0];
  for (auto& [instant, view] : seen.views)
    while (view.corners.back() >= stated.num_corners()) view.corners.pop_back(), view.pixels.pop_back();
  std::string said;
  try {
    said = fmt::format("{}", fmt::join(calibrate_intrinsics(seen, stated).notes, "; "));
  } catch (const Error& error) {
    said = error.what();
  }
  EXPECT_THAT(said, HasSubstr("are the numbers of squares of the board right, 6 x 6?"));
}

/// The lens of a fisheye camera whose image reaches to about 75 degrees from the axis.
Camera fisheye_camera() {
  Camera camera = desk_camera();
  camera.width = 800;
  camera.height = 600;
  camera.lens = Lens::fisheye;
  camera.K << 372, 0, 407, 0, 375, 295, 0, 0, 1;
  camera.distortion = {0.05, -0.02, 0.004, 0.001};
  return camera;
}

/// @param reach radians from the axis up to which the middle of the board lies
BoardSightings fisheye_sightings(const Camera& camera, const Board& board, double reach, int views) {
  std::vector<BoardPose> poses;
  for (int view = 0; view < views; ++view) {
    const double angle = reach * std::sqrt((view + 0.5) / views), round = 2.4 * view;
    const Eigen::Vector3d direction(std::sin(angle) * std::cos(round), std::sin(angle) * std::sin(round),
                                    std::cos(angle));
    poses.push_back(facing((0.6 + 0.15 * std::sin(1.3 * view)) * direction, {0, 0, 0}, 0.45 * std::sin(1.1 * view),
                           0.45 * std::cos(0.9 * view), 0.2 * std::sin(3.0 * view), board));
  }
  return sightings(camera, board, poses, 7);
}

/// The largest distance in pixels between two lenses over the directions up to an angle that the image shows, degrees.
double lens_error(const Camera& found, const Camera& ground_truth, double degrees) {
  double worst = 0.0;
  for (double angle = 1.0; angle <= degrees; angle += 1.0)
    for (const double round : {0.6, 2.5, 3.7, 5.6}) {
      const Eigen::Vector3d direction(std::sin(angle * kRadiansPerDegree) * std::cos(round),
                                      std::sin(angle * kRadiansPerDegree) * std::sin(round),
                                      std::cos(angle * kRadiansPerDegree));
      worst = std::max(worst, (found.project(direction) - ground_truth.project(direction)).norm());
    }
  return worst;
}

TEST(CalibrateBoard, FisheyeLensDoesNotTurnBackBeyondTheCorners) {
  const Board board = parse_board("chessboard:6x3:60mm");
  const Camera camera = fisheye_camera();
  BoardCalibrationOptions options;
  options.lens = Lens::fisheye;
  const CameraIntrinsics found = calibrate_intrinsics(fisheye_sightings(camera, board, 0.3, 24), board, options);
  EXPECT_EQ(found.camera.distortion[2], 0.0);
  EXPECT_EQ(found.camera.distortion[3], 0.0);
  EXPECT_LT(lens_error(found.camera, camera, 60.0), 12.0);
  EXPECT_GT(found.focal_sigma, 0.1);
  EXPECT_LT(std::abs(found.camera.K(0, 0) - camera.K(0, 0)), 4.0 * found.focal_sigma);
  EXPECT_THAT(found.notes, Contains(HasSubstr("the lens is extrapolated")));
}

TEST(CalibrateBoard, FisheyeLensIsFittedToItsRimWhereTheCornersReachIt) {
  const Board board = parse_board("chessboard:6x3:60mm");
  Camera camera = fisheye_camera();
  camera.K << 260, 0, 407, 0, 262, 295, 0, 0, 1;
  camera.distortion = {0.05, -0.05, 0.03, -0.008};
  BoardCalibrationOptions options;
  options.lens = Lens::fisheye;
  const CameraIntrinsics found = calibrate_intrinsics(fisheye_sightings(camera, board, 1.25, 40), board, options);
  EXPECT_NE(found.camera.distortion[3], 0.0);
  EXPECT_LT(lens_error(found.camera, camera, 65.0), 1.5);
  EXPECT_THAT(found.notes, IsEmpty());
}

TEST(CalibrateBoard, SaysWhereALensTurnsBack) {
  Camera camera = fisheye_camera();
  EXPECT_FALSE(angle_of_turning_back(camera));
  EXPECT_NEAR(angle_of_image_corner(camera) / kRadiansPerDegree, 75.0, 4.0);
  // theta (1 - theta^2) grows up to theta = 1 / sqrt(3), which is 33.1 degrees.
  camera.distortion = {-1.0};
  ASSERT_TRUE(angle_of_turning_back(camera));
  EXPECT_NEAR(*angle_of_turning_back(camera) / kRadiansPerDegree, 33.1, 0.5);
}

TEST(CalibrateBoard, CameraThatSharesNoInstantHasNoPose) {
  const Board board = parse_board("chessboard:7x4:40mm");
  const Camera camera = desk_camera();
  std::vector<BoardPose> poses;
  for (int view = 0; view < 12; ++view) poses.push_back(desk_pose(view, board));
  BoardSightings first = sightings(camera, board, poses, 1), second;
  second = first;
  second.camera = "other";
  second.views.clear();
  for (const auto& [instant, view] : first.views) second.views[instant + 1000] = view;
  const BoardCalibration found = calibrate_boards({first, second}, board);
  EXPECT_FALSE(found.cameras[0].posed);
  ASSERT_FALSE(found.notes.empty());
  EXPECT_THAT(found.notes[0], HasSubstr("no two cameras saw the board"));
}

TEST(CalibrateBoard, ImagesThatWereNotTakenTogetherGiveNoPoses) {
  const Board board = parse_board("chessboard:7x4:40mm");
  std::vector<BoardSightings> seen;
  for (int c = 0; c < 2; ++c) {
    std::vector<BoardPose> poses;
    for (int view = 0; view < 10; ++view) poses.push_back(desk_pose(view + 40 * c, board));
    seen.push_back(sightings(desk_camera(), board, poses, 1));
    seen.back().camera = c == 0 ? "left" : "right";
  }
  const BoardCalibration found = calibrate_boards(seen, board);
  EXPECT_FALSE(found.cameras[0].posed || found.cameras[1].posed);
  ASSERT_FALSE(found.notes.empty());
  EXPECT_THAT(found.notes[0], HasSubstr("not taken at the same instants"));
  EXPECT_NEAR(found.cameras[1].intrinsics.camera.K(0, 0) / desk_camera().K(0, 0), 1.0, 0.01);
}

TEST(CalibrateBoard, RefusesViewsFaceToFace) {
  const Board board = parse_board("chessboard:7x4:40mm");
  std::vector<BoardPose> poses(6, facing({0, 0, 0.6}, {0, 0, 0}, 0.0, 0.0, 0.0, board));
  EXPECT_THAT(message_of<Error>([&] { calibrate_intrinsics(sightings(desk_camera(), board, poses, 1), board); }),
              HasSubstr("different angles"));
}

}  // namespace
}  // namespace doppel
