#include "doppel/calibration/estimation/board.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "doppel/calibration/estimation/charuco_versions.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr int kMaxSquares = 100;
constexpr double kMaxSquare = 10.0;  // metres
constexpr int kSearchedSide = 1200;  // pixels; larger images are searched at this size
constexpr std::size_t kMinCorners = 6;
constexpr double kShareOfSpacing = 0.35;  // of the distance of two corners: half of the window that refines a corner
constexpr int kMaxHalfWindow = 15;

const std::map<std::string, int>& dictionaries() {
  static const std::map<std::string, int> kAll{{"DICT_4X4_50", cv::aruco::DICT_4X4_50},
                                               {"DICT_4X4_100", cv::aruco::DICT_4X4_100},
                                               {"DICT_4X4_250", cv::aruco::DICT_4X4_250},
                                               {"DICT_4X4_1000", cv::aruco::DICT_4X4_1000},
                                               {"DICT_5X5_50", cv::aruco::DICT_5X5_50},
                                               {"DICT_5X5_100", cv::aruco::DICT_5X5_100},
                                               {"DICT_5X5_250", cv::aruco::DICT_5X5_250},
                                               {"DICT_5X5_1000", cv::aruco::DICT_5X5_1000},
                                               {"DICT_6X6_50", cv::aruco::DICT_6X6_50},
                                               {"DICT_6X6_100", cv::aruco::DICT_6X6_100},
                                               {"DICT_6X6_250", cv::aruco::DICT_6X6_250},
                                               {"DICT_6X6_1000", cv::aruco::DICT_6X6_1000},
                                               {"DICT_7X7_50", cv::aruco::DICT_7X7_50},
                                               {"DICT_7X7_100", cv::aruco::DICT_7X7_100},
                                               {"DICT_7X7_250", cv::aruco::DICT_7X7_250},
                                               {"DICT_7X7_1000", cv::aruco::DICT_7X7_1000},
                                               {"DICT_ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL},
                                               {"DICT_APRILTAG_36h11", cv::aruco::DICT_APRILTAG_36h11}};
  return kAll;
}

std::vector<std::string> parts_of(const std::string& text) {
  std::vector<std::string> parts{""};
  for (const char letter : text) {
    if (letter == ':')
      parts.emplace_back();
    else
      parts.back() += letter;
  }
  return parts;
}

std::array<int, 2> parse_grid(const std::string& board, const std::string& text) {
  std::array<int, 2> grid{};
  int length = 0;
  const int found = std::sscanf(text.c_str(), "%4dx%4d%n", &grid[0], &grid[1], &length);
  if (found != 2 || length != static_cast<int>(text.size()) || std::min(grid[0], grid[1]) < 2 ||
      std::max(grid[0], grid[1]) > kMaxSquares)
    fail<UsageError>(
        "the board \"{}\": \"{}\" is no number of columns and rows; write for instance 6x3, each from 2 to {}", board,
        text, kMaxSquares);
  return grid;
}

double parse_length(const std::string& board, const std::string& text) {
  double number = 0.0;
  char unit[3] = "";
  int length = 0;
  const int found = std::sscanf(text.c_str(), "%lf%2[a-z]%n", &number, unit, &length);
  const std::string name = unit;
  const double metres = name == "mm" ? 1e-3 : name == "cm" ? 1e-2 : name == "m" ? 1.0 : 0.0;
  number *= metres;
  if (found != 2 || length != static_cast<int>(text.size()) || !(number > 0.0 && number <= kMaxSquare))
    fail<UsageError>(
        "the board \"{}\": \"{}\" is no length; write a number with mm, cm or m, for instance 60mm, up to {:g} m",
        board, text, kMaxSquare);
  return number;
}

cv::Mat grey(const cv::Mat& image) {
  if (image.empty() || image.depth() != CV_8U || (image.channels() != 1 && image.channels() != 3))
    fail("finding a board: the image has {} channels of another type than 8 bit, or no pixels", image.channels());
  cv::Mat result;
  if (image.channels() == 1)
    result = image;
  else
    cv::cvtColor(image, result, cv::COLOR_BGR2GRAY);
  return result;
}

/// The shortest distance of neighbouring corners in a grid.
double spacing(const std::vector<cv::Point2f>& corners, int columns) {
  double least = 1e9;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto column = static_cast<int>(i) % columns;
    if (column + 1 < columns) least = std::min(least, cv::norm(corners[i] - corners[i + 1]));
    if (i + as_size(columns) < corners.size())
      least = std::min(least, cv::norm(corners[i] - corners[i + as_size(columns)]));
  }
  return least;
}

/// Corners to a fraction of a pixel, in a window that holds no other corner.
void refine_corners(const cv::Mat& image, std::vector<cv::Point2f>& corners, double distance) {
  const int half = std::clamp(static_cast<int>(kShareOfSpacing * distance), 2, kMaxHalfWindow);
  cv::cornerSubPix(image, corners, {half, half}, {-1, -1}, {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 60, 1e-4});
}

/// The grey level in the middle of the square whose first corner is (column, row).
double level_in_square(const cv::Mat& image, const std::vector<cv::Point2f>& corners, int columns, int column,
                       int row) {
  const auto corner = [&](int c, int r) { return corners[r * columns + c]; };
  const cv::Point2f middle =
      0.25F * (corner(column, row) + corner(column + 1, row) + corner(column, row + 1) + corner(column + 1, row + 1));
  cv::Mat patch;
  cv::getRectSubPix(image, {3, 3}, middle, patch);
  return cv::mean(patch)[0];
}

/// Numbers the corners such that columns and rows turn as x and y of the image do, and that the square behind the first
/// corner is black. With an odd number of columns and rows together, only one numbering is like that.
void orient(const cv::Mat& image, std::vector<cv::Point2f>& corners, int columns, int rows) {
  const cv::Point2f across = corners[columns - 1] - corners[0];
  const cv::Point2f down = corners[(rows - 1) * columns] - corners[0];
  if (across.cross(down) < 0.0F)
    for (int r = 0; r < rows; ++r) std::reverse(corners.begin() + r * columns, corners.begin() + (r + 1) * columns);
  double even = 0.0, odd = 0.0;
  for (int r = 0; r + 1 < rows; ++r)
    for (int c = 0; c + 1 < columns; ++c)
      ((r + c) % 2 == 0 ? even : odd) += level_in_square(image, corners, columns, c, r);
  const int squares = (rows - 1) * (columns - 1);
  even /= (squares + 1) / 2;
  odd /= std::max(1, squares / 2);
  if ((columns + rows) % 2 == 1 && even > odd) std::reverse(corners.begin(), corners.end());
}

bool search(const cv::Mat& image, const cv::Size& size, std::vector<cv::Point2f>& corners) {
  constexpr int kFlags = cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE;
  if (cv::findChessboardCorners(image, size, corners, kFlags | cv::CALIB_CB_FAST_CHECK)) return true;
  return cv::findChessboardCornersSB(image, size, corners, cv::CALIB_CB_NORMALIZE_IMAGE);
}

std::optional<BoardView> find_chessboard(const cv::Mat& image, const Board& board) {
  const cv::Size size(board.columns, board.rows);
  const double scale = std::min(1.0, static_cast<double>(kSearchedSide) / std::max(image.cols, image.rows));
  cv::Mat smaller = image;
  if (scale < 1.0) cv::resize(image, smaller, {}, scale, scale, cv::INTER_AREA);
  std::vector<cv::Point2f> corners;
  if (search(smaller, size, corners)) {
    for (cv::Point2f& corner : corners) {
      corner.x = static_cast<float>((corner.x + 0.5) / scale - 0.5);
      corner.y = static_cast<float>((corner.y + 0.5) / scale - 0.5);
    }
  } else if (scale == 1.0 || !search(image, size, corners)) {
    return std::nullopt;
  }
  refine_corners(image, corners, spacing(corners, board.columns));
  orient(image, corners, board.columns, board.rows);
  BoardView view;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    view.corners.push_back(static_cast<int>(i));
    view.pixels.emplace_back(corners[i].x + 0.5, corners[i].y + 0.5);
  }
  return view;
}

using Markers = std::vector<std::vector<cv::Point2f>>;

/// How far markers in an image are from a homography of the board, as a share of their sides (root mean square).
double misfit(const cv::aruco::CharucoBoard& board, const Markers& markers, const std::vector<int>& ids) {
  std::vector<cv::Point2f> on_board, in_image, projected;
  double side = 0.0;
  for (std::size_t m = 0; m < ids.size(); ++m) {
    if (as_size(ids[m]) >= marker_corners(board).size()) continue;
    side += cv::norm(markers[m][0] - markers[m][1]) / static_cast<double>(ids.size());
    for (std::size_t k = 0; k < 4; ++k) {
      const cv::Point3f& corner = marker_corners(board)[as_size(ids[m])][k];
      on_board.emplace_back(corner.x, corner.y);
      in_image.push_back(markers[m][k]);
    }
  }
  const cv::Mat homography = on_board.empty() ? cv::Mat() : cv::findHomography(on_board, in_image);
  if (homography.empty()) return 1.0;
  cv::perspectiveTransform(on_board, projected, homography);
  return cv::norm(projected, in_image, cv::NORM_L2) / std::sqrt(static_cast<double>(in_image.size())) / side;
}

/// The board as it was drawn: a board with an even number of rows by OpenCV before or since 4.6.
cv::Ptr<cv::aruco::CharucoBoard> drawn_charuco(const Board& board, const Markers& markers,
                                               const std::vector<int>& ids) {
  const auto make = [&] {
    return charuco_board(board.columns, board.rows, board.square, board.marker,
                         aruco_dictionary(dictionaries().at(board.dictionary)));
  };
  auto charuco = make();
  if (board.rows % 2 == 1) return charuco;
  auto old = make();
  use_old_pattern(*old);
  return misfit(*old, markers, ids) < misfit(*charuco, markers, ids) ? old : charuco;
}

std::optional<BoardView> find_charuco(const cv::Mat& image, const Board& board) {
  Markers markers;
  std::vector<int> ids;
  cv::aruco::detectMarkers(image, aruco_dictionary(dictionaries().at(board.dictionary)), markers, ids,
                           aruco_parameters());
  if (ids.empty()) return std::nullopt;
  const auto charuco = drawn_charuco(board, markers, ids);
  std::vector<cv::Point2f> corners;
  std::vector<int> corner_ids;
  cv::aruco::interpolateCornersCharuco(markers, ids, image, charuco, corners, corner_ids);
  if (corner_ids.size() < kMinCorners) return std::nullopt;
  double side = 1e9;
  for (const auto& marker : markers) side = std::min(side, cv::norm(marker[0] - marker[1]));
  // The nearest other corner is that of a marker, half of the difference of the sides away.
  refine_corners(image, corners, side * std::max(0.3, (board.square - board.marker) / board.marker));
  BoardView view;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    view.corners.push_back(corner_ids[i]);
    view.pixels.emplace_back(corners[i].x + 0.5, corners[i].y + 0.5);
  }
  return view;
}

}  // namespace

Eigen::Vector3d Board::corner(int index) const {
  return {square * (index % corner_columns()), square * (index / corner_columns()), 0.0};
}

std::string Board::to_string() const {
  const std::string size = fmt::format("{}x{}:{:g}mm", columns, rows, 1000.0 * square);
  return kind == Kind::chessboard ? "chessboard:" + size
                                  : fmt::format("charuco:{}:{:g}mm:{}", size, 1000.0 * marker, dictionary);
}

Board parse_board(const std::string& text) {
  const std::vector<std::string> parts = parts_of(text);
  Board board;
  if (parts[0] == "chessboard" && parts.size() == 3) {
    board.kind = Board::Kind::chessboard;
  } else if (parts[0] == "charuco" && parts.size() == 5) {
    board.kind = Board::Kind::charuco;
  } else {
    fail<UsageError>(
        "\"{}\" is no board; write chessboard:COLUMNSxROWS:SQUARE with the number of inner corners, for instance "
        "chessboard:6x3:60mm, or charuco:COLUMNSxROWS:SQUARE:MARKER:DICTIONARY with the number of squares, for "
        "instance charuco:8x5:40mm:30mm:DICT_4X4_50",
        text);
  }
  const auto [columns, rows] = parse_grid(text, parts[1]);
  board.columns = columns;
  board.rows = rows;
  board.square = parse_length(text, parts[2]);
  if (board.kind == Board::Kind::chessboard) {
    if (std::min(columns, rows) < 3)
      fail<UsageError>("the board \"{}\" has {}x{} inner corners; a chessboard needs at least 3x3", text, columns,
                       rows);
    return board;
  }
  board.marker = parse_length(text, parts[3]);
  board.dictionary = parts[4];
  if (board.marker >= board.square)
    fail<UsageError>("the board \"{}\": its markers are not smaller than its squares", text);
  if (std::min(columns, rows) < 3)
    fail<UsageError>("the board \"{}\" has {}x{} squares; a ChArUco board needs at least 3x3", text, columns, rows);
  if (dictionaries().count(board.dictionary) == 0) {
    std::string known;
    for (const auto& [name, value] : dictionaries()) known += (known.empty() ? "" : ", ") + name;
    fail<UsageError>("the board \"{}\": \"{}\" is no dictionary; known are {}", text, board.dictionary, known);
  }
  return board;
}

std::optional<BoardView> find_board(const cv::Mat& image, const Board& board) {
  const cv::Mat level = grey(image);
  return board.kind == Board::Kind::chessboard ? find_chessboard(level, board) : find_charuco(level, board);
}

}  // namespace doppel
