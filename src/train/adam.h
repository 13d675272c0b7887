#pragma once

#include <torch/nn/module.h>
#include <torch/optim/adam.h>
#include <torch/types.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "doppel/core/options.h"

namespace doppel {

class Checkpoint;

/// Options of the optimiser. Defaults are those of the thesis (no decay, no clipping).
struct AdamOptions {
  double epsilon = 1e-8;
  double weight_decay = 0.0;  ///< of the weights themselves (AdamW), per step and unit of learning rate
  double clip_norm = 0.0;     ///< largest norm of the gradient of all parameters; 0 = no clipping
  double mean_decay = 0.0;    ///< running mean of the weights, mean = decay * mean + (1 - decay) * weights; 0 = none
};
void describe_keys(const Keys& keys, AdamOptions& options);

/// Adam in one pass over memory: one parallel region of flat loops updates all parameters in place (the eager optimiser
/// launches a dozen operations per tensor). Parameters are float32, contiguous, on the CPU; those without a gradient
/// are not changed. Results equal torch::optim::Adam / AdamW up to rounding, and are bitwise independent of the number
/// of threads.
class Adam {
 public:
  /// Parameters that share settings. `learning_rate_scale` multiplies the rate given to `step`.
  struct Group {
    std::vector<std::pair<std::string, torch::Tensor>> parameters;
    double learning_rate_scale = 1.0;
    double weight_decay_scale = 1.0;
  };

  /// @throws Error naming the parameter that is not a contiguous float32 CPU tensor
  Adam(const std::vector<Group>& groups, const AdamOptions& options);
  /// All parameters of a module. Weight decay leaves out parameters of one dimension, biases, and the parameters of
  /// layers named `norm`.
  Adam(const torch::nn::Module& module, const AdamOptions& options);

  /// Norm of the gradient of all parameters (not finite if any gradient is not).
  double gradient_norm() const;
  /// The first parameter whose gradient holds a NaN or an infinity.
  std::optional<std::string> non_finite_gradient() const;
  /// Updates the parameters. @param norm the result of `gradient_norm`, used for clipping only
  void step(double learning_rate, double norm);
  /// Drops the gradients, so that the next backward pass stores its own instead of adding to zeros.
  void zero_grad();

  std::int64_t steps() const { return steps_; }
  /// Running mean of the weights by name; empty without `mean_decay`.
  std::vector<std::pair<std::string, torch::Tensor>> mean_weights() const;

  /// Whether a parameter of this name can still get a gradient.
  using IsTrained = std::function<bool(const std::string& parameter)>;
  /// Saves moments, means and step count. Their names begin with `optimizer.`. The moments of a parameter that has had
  /// no gradient are 0, and those of a parameter that gets none any more are not needed; neither are saved.
  /// @param is_trained empty: every parameter
  void save(Checkpoint& checkpoint, const IsTrained& is_trained = {}) const;
  /// Moments that the checkpoint need not hold may be there, as in the checkpoints of earlier versions.
  /// @param is_trained as for `save` @throws Error when a tensor is missing or has another shape
  void load(const Checkpoint& checkpoint, const IsTrained& is_trained = {});

 private:
  struct Slot {
    std::string name;
    torch::Tensor parameter, first, second, mean;
    double learning_rate_scale, weight_decay_scale;
    std::int64_t steps = 0;  ///< steps with a gradient; others do not change its moments
  };
  /// A piece of one parameter; the unit of parallel work.
  struct Chunk {
    std::size_t slot;
    std::int64_t begin, end;
  };
  void add(const Group& group);
  static bool needs_moments(const Slot& slot, const IsTrained& is_trained);

  AdamOptions options_;
  std::vector<Slot> slots_;
  std::vector<Chunk> chunks_;
  std::int64_t steps_ = 0;
};

}  // namespace doppel
