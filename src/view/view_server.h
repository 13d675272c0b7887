#pragma once

#include <memory>
#include <string>

#include "doppel/view/view_subject.h"

namespace doppel {

/// A web server of one subject on the loopback interface. A request needs the token, in the address (`?token=`) or in
/// the cookie that the page sets; otherwise the answer is 403. Nothing is read from the disk on request, so no path can
/// lead anywhere. Requests are at most 1 MB, and a connection that stands still for five seconds is closed.
///
/// | request | answer |
/// |---|---|
/// | `GET /` | the page |
/// | `GET /api/description` | JSON: name, sizes, frame rate, DoFs with limits, joints, stages |
/// | `GET /api/mesh` | uint32 counts of corners and split vertices; uint32 corners [3F]; uint32 template vertex of each
/// split vertex [S]; float32 UVs [S,2] | | `GET /api/texture` | the template's texture, JPEG; 404 without | | `GET
/// /api/motion` | float32 [frames, D] | | `GET /api/frame?i=0&stage=skinning` | float32 vertices [N,3], then joints
/// [J,3], world metres | | `POST /api/pose?stage=skinning` with float32 [D] | the same, for a pose that stands still |
/// | `POST /api/reach?joint=3&x=0&y=1&z=0` with float32 [D] | float32 [D+1]: the pose and the distance left, metres |
class ViewServer {
 public:
  /// Binds the port; 0: any free one. @throws Error when the port is taken
  ViewServer(ViewSubject subject, int port);
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
