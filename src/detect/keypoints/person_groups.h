#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "doppel/detect/keypoints/keypoints.h"
#include "doppel/geometry/camera.h"
#include "doppel/geometry/triangulation.h"

namespace doppel {

/// The detections of one person in the cameras of one frame, and the body that they agree on.
struct PersonGroup {
  std::vector<int> chosen;                           ///< [C] index into the camera's people; -1: none
  std::vector<std::optional<Eigen::Vector3d>> body;  ///< [n] triangulated points, world metres
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< median of the body's points
  int views = 0;                                     ///< cameras that agree
  double support = 0.0;                              ///< sum over these of the share of points that agree
  double residual = 0.0;                             ///< mean of the agreeing points, share of the image's height
};

/// Finds people in single frames by the agreement of cameras (person_choice.h).
class PersonGrouper {
 public:
  /// @param mirrored [n] for each point its counterpart on the other side of the body
  /// @param max_residual of a point that agrees, as a share of the image's height
  PersonGrouper(const std::vector<Camera>& cameras, std::vector<int> mirrored, double max_residual);

  /// Everybody on whom at least two cameras agree. No detection is in two groups. @param people [C]
  std::vector<PersonGroup> find(const std::vector<People>& people) const;

  /// The detections that agree with a known body, within `tolerance` times the largest residual.
  /// @param body [n]
  PersonGroup match(const std::vector<People>& people, const std::vector<std::optional<Eigen::Vector3d>>& body,
                    double tolerance) const;

 private:
  using SeenPoint = std::optional<Sight>;  ///< residuals are shares of the image's height
  using Detection = std::vector<SeenPoint>;
  using Frame = std::vector<std::vector<Detection>>;  ///< [C] of people
  using Body = std::vector<std::optional<Eigen::Vector3d>>;
  struct Proposal {
    double residual = 0.0;
    int camera[2] = {-1, -1}, person[2] = {-1, -1};
    Body body;
  };
  /// How well a detection fits a body.
  struct Fit {
    int agreeing = 0, shared = 0;
    double sum = 0.0;
    bool mirrored = false;
    bool better_than(const Fit& other) const;
  };

  Frame seen(const std::vector<People>& people) const;
  std::vector<Proposal> proposals(const Frame& frame) const;
  void propose(const Frame& frame, Proposal proposal, std::vector<Proposal>& all) const;
  PersonGroup grow(const Frame& frame, const Body& body) const;
  PersonGroup assign(const Frame& frame, const Body& body, double limit, std::vector<bool>& mirrored) const;
  Fit fit(const Detection& detection, const Body& body, double limit, bool mirrored) const;
  Body triangulated(const Frame& frame, const PersonGroup& group, const std::vector<bool>& mirrored) const;

  std::vector<Camera> cameras_;
  std::vector<int> mirrored_;
  double max_residual_;
};

}  // namespace doppel
