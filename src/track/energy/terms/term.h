#pragma once

#include <string>

#include "doppel/track/energy/graph_model.h"
#include "doppel/track/energy/pose_model.h"
#include "doppel/track/energy/shape_model.h"

namespace doppel {

/// One term of an energy. A term fills rows with its residuals and jacobians; the rows apply weights and robust kernels
/// and sum up the cost. `Model` defines the unknowns and the positions of vertices and landmarks: a `PoseModel`, a
/// `GraphModel` or a `ShapeModel`. Terms that use only vertices and landmarks serve all of them.
template <typename Model>
class Term {
 public:
  using State = typename Model::State;
  using Rows = typename Model::Rows;

  virtual ~Term() = default;
  virtual std::string name() const = 0;
  /// Called before every step, at the state that the step starts from. Chooses what stays constant during the step.
  virtual void freeze(const Model&, const State&) {}
  /// Fills `rows`. @param jacobian fill the jacobians too; `state` must then have been computed with jacobians
  virtual void evaluate(const Model& model, const State& state, bool jacobian, Rows& rows) const = 0;
  /// `freeze`, then `evaluate` with jacobians. A term overrides this function to share work between the two.
  virtual void linearise(const Model& model, const State& state, Rows& rows) {
    freeze(model, state);
    evaluate(model, state, true, rows);
  }
};

using PoseTerm = Term<PoseModel>;
using GraphTerm = Term<GraphModel>;
using ShapeTerm = Term<ShapeModel>;

}  // namespace doppel
