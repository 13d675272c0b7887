// For the tests under ThreadSanitizer: OpenCV's loops take the calling thread alone. They run on TBB, which is not
// instrumented, so the sanitizer cannot see how such a loop ends and reports each use of its results.
#include <opencv2/core/utility.hpp>

[[maybe_unused]] static const bool kOneThread = (cv::setNumThreads(1), true);
