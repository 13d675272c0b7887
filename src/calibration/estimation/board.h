#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// A flat calibration board.
struct Board {
  enum class Kind { chessboard, charuco };
  Kind kind = Kind::chessboard;
  int columns = 0, rows = 0;  ///< chessboard: inner corners; ChArUco: squares
  double square = 0.0;        ///< side of a square, metres
  double marker = 0.0;        ///< side of a marker, metres; ChArUco only
  std::string dictionary;     ///< of the markers, for instance "DICT_4X4_50"; ChArUco only

  int num_corners() const { return kind == Kind::chessboard ? columns * rows : (columns - 1) * (rows - 1); }
  int corner_columns() const { return kind == Kind::chessboard ? columns : columns - 1; }
  /// Corner in the board's plane, metres: x to the right, y down, z = 0.
  Eigen::Vector3d corner(int index) const;
  std::string to_string() const;
};

/// Reads "chessboard:6x3:60mm" (inner corners, side of a square) or "charuco:COLSxROWS:SQUARE:MARKER:DICT" (squares).
/// Lengths have a unit: mm, cm or m.
/// @throws UsageError says which part is wrong and what is allowed
Board parse_board(const std::string& text);

/// The corners of a board in one image.
struct BoardView {
  std::vector<int> corners;             ///< indices of the corners found
  std::vector<Eigen::Vector2d> pixels;  ///< the centre of the first pixel is (0.5, 0.5)
};

/// Finds a board, by OpenCV. A chessboard must be seen whole, a ChArUco board may be cut off or covered in part.
/// @param image 8 bit, grey or BGR
/// @return nothing when there is no board
std::optional<BoardView> find_board(const cv::Mat& image, const Board& board);

}  // namespace doppel
