#pragma once

#include <opencv2/aruco/charuco.hpp>

/// ChArUco boards in every version of OpenCV. OpenCV 4.7 changed the types of its module aruco. The square at the upper
/// left is black, as OpenCV 4.6 and all later versions draw it; before 4.6, boards with an even number of rows had a
/// white one there, which is not read.

namespace doppel {

/// @param name an enumerator of OpenCV such as cv::aruco::DICT_4X4_50
inline cv::Ptr<cv::aruco::Dictionary> aruco_dictionary(int name);

/// @param square, marker the sides of a square and of a marker, metres
inline cv::Ptr<cv::aruco::CharucoBoard> charuco_board(int columns, int rows, double square, double marker,
                                                      const cv::Ptr<cv::aruco::Dictionary>& dictionary);

/// The parameters of the search for markers, as OpenCV chooses them.
inline cv::Ptr<cv::aruco::DetectorParameters> aruco_parameters();

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

cv::Ptr<cv::aruco::DetectorParameters> aruco_parameters() { return cv::makePtr<cv::aruco::DetectorParameters>(); }

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

cv::Ptr<cv::aruco::DetectorParameters> aruco_parameters() { return cv::aruco::DetectorParameters::create(); }

cv::Mat draw_charuco(const cv::Ptr<cv::aruco::CharucoBoard>& board, const cv::Size& pixels) {
  cv::Mat image;
  board->draw(pixels, image);
  return image;
}
#endif

}  // namespace doppel
