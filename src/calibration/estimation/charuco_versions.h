#pragma once

#include <opencv2/aruco/charuco.hpp>
#include <vector>

/// ChArUco boards in every version of OpenCV. OpenCV 4.7 changed the types of its module aruco. The square at the upper
/// left is black, as OpenCV 4.6 and all later versions draw it; before 4.6, boards with an even number of rows had a
/// white one there.

namespace doppel {

/// @param name an enumerator of OpenCV such as cv::aruco::DICT_4X4_50
inline cv::Ptr<cv::aruco::Dictionary> aruco_dictionary(int name);

/// @param square, marker the sides of a square and of a marker, metres
inline cv::Ptr<cv::aruco::CharucoBoard> charuco_board(int columns, int rows, double square, double marker,
                                                      const cv::Ptr<cv::aruco::Dictionary>& dictionary);

/// Makes the square at the upper left of a board white, as before OpenCV 4.6. @pre an even number of rows
inline void use_old_pattern(cv::aruco::CharucoBoard& board);

/// The corners of each marker on the board, by its number.
inline const std::vector<std::vector<cv::Point3f>>& marker_corners(const cv::aruco::CharucoBoard& board);

/// The parameters of the search for markers, as OpenCV chooses them.
inline cv::Ptr<cv::aruco::DetectorParameters> aruco_parameters();

/// Draws a marker. @param side pixels
inline cv::Mat draw_marker(const cv::Ptr<cv::aruco::Dictionary>& dictionary, int number, int side);

/// Draws a board without a margin.
inline cv::Mat draw_charuco(const cv::Ptr<cv::aruco::CharucoBoard>& board, const cv::Size& pixels);

#if CV_VERSION_MAJOR > 4 || CV_VERSION_MINOR >= 7
cv::Ptr<cv::aruco::Dictionary> aruco_dictionary(int name) {
  return cv::makePtr<cv::aruco::Dictionary>(cv::aruco::getPredefinedDictionary(name));
}

cv::Ptr<cv::aruco::CharucoBoard> charuco_board(int columns, int rows, double square, double marker,
                                               const cv::Ptr<cv::aruco::Dictionary>& dictionary) {
  return cv::makePtr<cv::aruco::CharucoBoard>(cv::Size(columns, rows), static_cast<float>(square),
                                              static_cast<float>(marker), *dictionary);
}

void use_old_pattern(cv::aruco::CharucoBoard& board) { board.setLegacyPattern(true); }

const std::vector<std::vector<cv::Point3f>>& marker_corners(const cv::aruco::CharucoBoard& board) {
  return board.getObjPoints();
}

cv::Ptr<cv::aruco::DetectorParameters> aruco_parameters() { return cv::makePtr<cv::aruco::DetectorParameters>(); }

cv::Mat draw_marker(const cv::Ptr<cv::aruco::Dictionary>& dictionary, int number, int side) {
  cv::Mat image;
  dictionary->generateImageMarker(number, side, image);
  return image;
}

cv::Mat draw_charuco(const cv::Ptr<cv::aruco::CharucoBoard>& board, const cv::Size& pixels) {
  cv::Mat image;
  board->generateImage(pixels, image);
  return image;
}
#else
cv::Ptr<cv::aruco::Dictionary> aruco_dictionary(int name) { return cv::aruco::getPredefinedDictionary(name); }

cv::Ptr<cv::aruco::CharucoBoard> charuco_board(int columns, int rows, double square, double marker,
                                               const cv::Ptr<cv::aruco::Dictionary>& dictionary) {
  return cv::aruco::CharucoBoard::create(columns, rows, static_cast<float>(square), static_cast<float>(marker),
                                         dictionary);
}

void use_old_pattern(cv::aruco::CharucoBoard& board) {
  const auto [columns, rows] = std::pair(board.getChessboardSize().width, board.getChessboardSize().height);
  const float square = board.getSquareLength();
  // The markers keep their order, row by row; each moves to the square beside its own.
  std::vector<cv::Point2f> shifts;
  for (int row = 0; row < rows; ++row)
    for (int column = row % 2; column < columns; column += 2) shifts.emplace_back(column, row);
  std::size_t marker = 0;
  for (int row = 0; row < rows; ++row)
    for (int column = 1 - row % 2; column < columns; column += 2, ++marker) {
      const cv::Point2f moved = square * (shifts[marker] - cv::Point2f(column, row));
      for (cv::Point3f& corner : board.objPoints[marker]) corner += {moved.x, moved.y, 0.0F};
    }
  // A corner of four squares touches two markers.
  for (std::size_t i = 0; i < board.chessboardCorners.size(); ++i) {
    board.nearestMarkerIdx[i].clear();
    board.nearestMarkerCorners[i].clear();
    for (std::size_t m = 0; m < board.objPoints.size(); ++m)
      for (int k = 0; k < 4; ++k)
        if (cv::norm(board.objPoints[m][k] - board.chessboardCorners[i]) < 0.75 * (square - board.getMarkerLength())) {
          board.nearestMarkerIdx[i].push_back(static_cast<int>(m));
          board.nearestMarkerCorners[i].push_back(k);
        }
  }
}

const std::vector<std::vector<cv::Point3f>>& marker_corners(const cv::aruco::CharucoBoard& board) {
  return board.objPoints;
}

cv::Ptr<cv::aruco::DetectorParameters> aruco_parameters() { return cv::aruco::DetectorParameters::create(); }

cv::Mat draw_marker(const cv::Ptr<cv::aruco::Dictionary>& dictionary, int number, int side) {
  cv::Mat image;
  dictionary->drawMarker(number, side, image);
  return image;
}

cv::Mat draw_charuco(const cv::Ptr<cv::aruco::CharucoBoard>& board, const cv::Size& pixels) {
  cv::Mat image;
  board->draw(pixels, image);
  return image;
}
#endif

}  // namespace doppel
