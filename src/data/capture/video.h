#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// The images of one camera in order, from a video file or from one file per frame, turned as the metadata of the files
/// say (rotation of a video, EXIF orientation of an image). Videos are decoded once, strictly forward, because seeking
/// by frame number is not exact in most containers.
class FrameReader {
 public:
  virtual ~FrameReader() = default;
  /// The image of `frame`, 8-bit, of the reader's PixelFormat. Frames must be read in ascending order,
  /// where the same frame may be read again; frames in between are skipped. The result may share memory with the reader
  /// until the next call.
  /// @throws FileError naming the frame when it is missing or cannot be decoded
  virtual cv::Mat read(long frame) = 0;
  /// Size of the images.
  virtual cv::Size size() = 0;
  /// Exact number of frames (for images: the highest frame number + 1).
  /// @param expected the header of a video is believed if it gives this number; otherwise the whole video may be
  /// decoded to count @throws FileError when no frame of a video can be decoded
  virtual long num_frames(long expected) = 0;
  virtual const std::string& source() const = 0;
  /// The time stamp of the image that was read last; nothing for images, which have none.
  virtual std::optional<double> seconds() const { return std::nullopt; }
  /// Some images, at most `most`, from the whole recording: of a video, of frames that are known roughly. Reading goes
  /// on as if it had not been called. @throws FileError as `read`
  virtual std::vector<cv::Mat> samples(int most) = 0;
};

/// What a file of footage says of itself.
struct FootageFacts {
  int width = 0, height = 0;
  double fps = 0.0;  ///< frames per second; 0: not stated, as in images
  long frames = 0;   ///< as the header says, which may be an estimate
};
/// @param path of a video, or of one image @throws FileError when the file is missing, or neither of both
FootageFacts inspect_footage(const std::string& path);

enum class PixelFormat {
  colour,  ///< BGR
  grey,    ///< brightness
  /// What shows the person: the alpha channel of images in which it varies, brightness of all others. Both are at least
  /// 1 where they are not 0, however many bits the file has.
  mask,
};

/// Opens a video file, a pattern that contains `{frame}`, or a folder of images, whose frames are their positions in
/// natural order. @throws FileError when the file is missing or not a video
std::unique_ptr<FrameReader> open_frames(const std::string& source, PixelFormat format);

}  // namespace doppel
