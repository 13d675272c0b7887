#pragma once

#include <string>

#include "doppel/energy/graph_model.h"
#include "doppel/energy/pose_model.h"

namespace doppel {

/// One part of an energy. A term fills in the rows of its residuals and their jacobian; weights, robust kernels and sums
/// are the rows' affair. `Model` says what is unknown and where points of the body are: a `PoseModel` or a
/// `GraphModel`; terms that ask only for vertices and landmarks serve both.
template <typename Model>
class Term {
 public:
  using State = typename Model::State;
  using Rows = typename Model::Rows;

  virtual ~Term() = default;
  virtual std::string name() const = 0;
  /// Called before every step, at the state that it starts from: chooses what stays constant during the step.
  virtual void freeze(const Model&, const State&) {}
  /// @param jacobian whether the rows carry jacobian; then `state` was worked out with them
  virtual void evaluate(const Model& model, const State& state, bool jacobian, Rows& rows) const = 0;
  /// `freeze`, then the rows with jacobian. A term that would work out the same twice does both in one go.
  virtual void linearise(const Model& model, const State& state, Rows& rows) {
    freeze(model, state);
    evaluate(model, state, true, rows);
  }
};

using PoseTerm = Term<PoseModel>;
using GraphTerm = Term<GraphModel>;

}  // namespace doppel
