#pragma once

#include <array>
#include <string>
#include <vector>

#include "doppel/character/skeleton.h"
#include "doppel/core/random.h"

namespace doppel::synth {

/// A sum of three sinusoids of random frequency and phase, within [-1, 1].
class Wave {
 public:
  /// @param slowest, fastest range of the frequencies, Hz
  Wave(Random& random, double slowest, double fastest);
  /// @param t seconds
  double operator()(double t) const;

 private:
  struct Term {
    double hertz = 0, phase = 0;
  };
  std::array<Term, 3> terms_;
};

/// A pose of the actor under construction, by the names of the DoFs.
class Pose {
 public:
  explicit Pose(const Skeleton& skeleton) : skeleton_(skeleton), dofs(skeleton.num_dofs(), 0.0) {}

  /// @throws Error when the skeleton has no such DoF
  double& operator[](const std::string& name);
  /// Moves DoFs that exceed their limits to these.
  void keep_limits();

 private:
  const Skeleton& skeleton_;

 public:
  std::vector<double> dofs;
};

/// "Left" and "Right", as DoFs begin with.
extern const std::array<const char*, 2> kSides;

// Parts of movements, which add to a pose. Most have an `amount`: 0 not at all, 1 fully.

/// Bends hips, knees and ankles so that the soles stay level; 1: a deep squat.
void bend_legs(Pose& pose, double amount);
/// A step cycle with swinging arms. @param phase radians
void walk(Pose& pose, double phase, double amount);
/// Jumps, one in 0.9 s. @param t seconds since the beginning @return height of the feet above the floor, metres
double jump(Pose& pose, double t, double amount);
/// Twists of the hips over standing feet. @param t seconds @param phase radians
void sway(Pose& pose, double t, double phase, double amount);

}  // namespace doppel::synth
