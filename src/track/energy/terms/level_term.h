#pragma once

#include <memory>
#include <string>
#include <vector>

#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// Another term whose residuals may all differ from zero by the same number. The residuals are r_i - r' with the
/// weighted mean r' of the other term's residuals r_i; the weights, those of the robust kernel included, are those at
/// the start of the step. For a silhouette: the mean distance between clothes and template is free. Loose clothes
/// enlarge an outline on all sides, as if the person were nearer; levelled, the outline does not say how near it is.
class LevelTerm : public PoseTerm {
 public:
  /// @param term with one row in each group, and the same rows in a step
  explicit LevelTerm(std::unique_ptr<PoseTerm> term) : term_(std::move(term)) {}

  std::string name() const override { return term_->name(); }
  void freeze(const PoseModel& model, const PosedBody& body) override;
  void evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const override;
  void linearise(const PoseModel& model, const PosedBody& body, Residuals& rows) override;

 private:
  void weigh(const Residuals& rows);
  void level(Residuals& rows) const;

  std::unique_ptr<PoseTerm> term_;
  std::vector<double> shares_;  ///< [rows] of r'; their sum is 1
};

}  // namespace doppel
