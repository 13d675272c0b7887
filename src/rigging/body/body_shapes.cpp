#include "doppel/rigging/body/body_shapes.h"

#include "doppel/rigging/body/measures.h"

namespace doppel {

BodyShapes::BodyShapes(std::string name, const BodyModel& model) : name_(std::move(name)), model_(model) {
  const std::vector<double> means = mean_measures(), deviations = measure_deviations();
  for (std::size_t p = 0; p < means.size(); ++p) {
    const BodyMeasure& measure = body_measures()[p];
    parameters_.push_back({measure.name, means[p], deviations[p], measure.low, measure.high});
  }
}

}  // namespace doppel
