#pragma once

#include <memory>
#include <string>

#include "doppel/view/view_subject.h"

namespace doppel {

/// A web server of one subject on the loopback interface. A request needs the token, in the address (`?token=`) or in
/// the header `Doppel-Token`; otherwise the answer is 403. So is the answer to a page of another site or port, which
/// browsers name in `Origin` or `Sec-Fetch-Site`; and a browser must post with the header. There is no cookie, because
/// browsers send cookies to the servers of all ports. A request names cameras, frames and images by number, never by a
/// path, so none can lead anywhere. Requests are at most 1 MB (motion files 64 MB). view_connections.h says how many
/// connections there may be and how long they may wait.
///
/// - `GET /`: the page
/// - `GET /double/description.json`, `mesh.bin`, `motion.bin`, `texture.jpg`, `points.bin`: see view_files.h. With
///   `?motion=N`, those of motion N (0: the subject's own), else of the newest
/// - `GET /api/frame?i=0&stage=skinning`: a frame of the newest motion, or of `&motion=N`: float32 vertices [N,3], then
///   joints [J,3], world metres. For a stage with a dynamic texture, `&projection=` gives the camera, twelve numbers
///   [3,4] (pixels from world metres), and the texture follows: uint8 RGBA [T,T,4], row 0 at v = 1. For a stage with
///   Gaussians, the same, and float32 rows [P,14] follow (splat_rows.h)
/// - `POST /api/pose?stage=skinning` with float32 [D]: the same for a pose that stands still
/// - `POST /api/motion?name=walk.bvh` with the bytes of a motion file: the newest motion from now on (motion_for); JSON
///   with `frames` and `motion`, its number, or 400 and what is wrong with the file. Of visitors' motions, the last
///   four are kept, so that each page can play its own
/// - `GET /api/cameras`: the cameras of the capture, JSON (ViewCameras::description); 400 without cameras
/// - `GET /api/picture?camera=0&frame=0&mask=0`: a JPEG of what the camera filmed (ViewCameras::image)
/// - `GET /api/training`: the curves and images of the run so far, JSON (view_training.h); 400 for other targets
/// - `GET /api/training_image?stage=0&image=0`: one of these images, JPEG
/// - `POST /api/live?tracked=1` with float32 [D]: a pose of somebody who is tracked now (view_sender.h)
/// - `GET /api/live?after=0&stage=skinning`: waits up to two seconds for a live pose after that number; then uint32 its
///   number and whether the person is seen, float32 [D], and what `/api/frame` gives, for a window of the newest poses.
///   Empty: there was none
/// - `POST /api/joints` with float32 [B,D]: float32 joints [B,J,3], world metres
///
/// For a sequence without a character, the requests that need one get 400 and say so.
class ViewServer {
 public:
  /// Binds the port; 0: any free one. @throws Error when the port is taken
  ViewServer(ViewSubject subject, int port);
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;
  ~ViewServer();

  /// `http://127.0.0.1:PORT/?token=...`
  const std::string& url() const { return url_; }
  /// Serves until `stop` is called from another thread.
  void serve();
  void stop();

 private:
  struct State;
  std::unique_ptr<State> state_;
  std::string url_;
};

}  // namespace doppel
