/// Dual-quaternion skinning against its two eager tensor forms: the same work, the same inputs (unit quaternions,
/// translations and rest points of each item, all with gradients), outputs and gradients checked equal first.
///   skinning_bench [threads = 2]

#include <cstdio>
#include <cstdlib>

#include "doppel/layers/skinning/skinning.h"
#include "layers/body.h"
#include "support/ratio.h"

namespace doppel::bench {
namespace {

using torch::Tensor;

struct Inputs {
  Tensor q, t, points;
  std::vector<Tensor> all() const { return {q, t, points}; }
};

Inputs make_inputs(const Body& body, int64_t batch) {
  torch::manual_seed(0);
  // Small turns: without aligned signs the dense form is right only within one hemisphere.
  Tensor q = 0.15 * torch::randn({batch, 70, 4});
  q.select(-1, 0) += 1.0;
  Inputs inputs;
  inputs.q = (q / q.norm(2, {-1}, true)).requires_grad_();
  inputs.t = (0.3 * torch::randn({batch, 70, 3})).requires_grad_();
  inputs.points = points_tensor(body.vertices).expand({batch, -1, 3}).clone().requires_grad_();
  return inputs;
}

Tensor dual_quaternions(const Inputs& in) {
  const Tensor w = in.q.narrow(-1, 0, 1), v = in.q.narrow(-1, 1, 3);
  const Tensor vector = in.t * w + torch::cross(in.t, v, -1);
  return torch::cat({in.q, -0.5 * (in.t * v).sum(-1, true), 0.5 * vector}, -1);
}

Tensor apply(const Tensor& blended, const Tensor& points) {
  const Tensor unit = blended / blended.narrow(-1, 0, 4).norm(2, {-1}, true);
  const Tensor w = unit.narrow(-1, 0, 1), v = unit.narrow(-1, 1, 3);
  const Tensor ew = unit.narrow(-1, 4, 1), ev = unit.narrow(-1, 5, 3);
  const Tensor turned = points + 2.0 * torch::cross(v, torch::cross(v, points, -1) + w * points, -1);
  return turned + 2.0 * (w * ev - ew * v + torch::cross(v, ev, -1));
}

Tensor gather_form(const Inputs& in, const Tensor& items, const Tensor& weights) {
  const int64_t N = items.size(0), P = items.size(1), B = in.q.size(0);
  const Tensor bones = dual_quaternions(in).index_select(1, items.flatten()).view({B, N, P, 8});
  const Tensor cosine = (bones.narrow(-1, 0, 4) * bones.narrow(2, 0, 1).narrow(-1, 0, 4)).sum(-1, true);
  const Tensor sign = torch::where(cosine < 0, -torch::ones_like(cosine), torch::ones_like(cosine)).detach();
  return apply((bones * (sign * weights.unsqueeze(-1))).sum(2), in.points);
}

Tensor dense_form(const Inputs& in, const Tensor& matrix) {
  return apply(torch::matmul(matrix, dual_quaternions(in)), in.points);
}

/// The nine numbers of a rotation, each a quadratic form of the quaternion: [16,9], for few and large operations.
Tensor rotation_forms() {
  Tensor forms = torch::zeros({4, 4, 9});
  const auto add = [&](int entry, int i, int j, float value) { forms[i][j][entry] += value; };
  for (int r = 0; r < 3; ++r) {
    const int a = 1 + (r + 1) % 3, b = 1 + (r + 2) % 3;
    for (int square : {a, b}) add(4 * r, square, square, -2.0f);
    // Entry (r, r+1): 2 (v_r v_a - w v_b); entry (r+1, r): 2 (v_r v_a + w v_b).
    const int c = (r + 1) % 3;
    for (int entry : {3 * r + c, 3 * c + r}) add(entry, 1 + r, a, 2.0f);
    add(3 * r + c, 0, b, -2.0f);
    add(3 * c + r, 0, b, 2.0f);
  }
  return forms.view({16, 9});
}

Tensor kernel_form(const Inputs& in, Skinning& skinning, const Tensor& forms) {
  const Tensor products = (in.q.unsqueeze(-1) * in.q.unsqueeze(-2)).view({-1, 70, 16});
  const Tensor rotation = torch::matmul(products, forms).view({-1, 70, 3, 3}) + torch::eye(3);
  return skinning->forward(in.points, torch::cat({rotation, in.t.unsqueeze(-1)}, -1));
}

/// The part of a gradient to unit quaternions that lies along rotations.
Tensor tangent(const Tensor& gradient, const Tensor& q) { return gradient - q * (gradient * q).sum(-1, true); }

void run(const Body& body, int64_t batch) {
  Skinning skinning(body.skin);
  const Tensor items = skinning->weights().padded_items,
               weights = skinning->weights().padded_weights.to(torch::kFloat32);
  const Tensor matrix = dense_matrix(items, weights, 70);
  const Inputs in = make_inputs(body, batch);
  const Tensor probe = torch::randn({batch, items.size(0), 3});
  const auto gather = [&] { return gather_form(in, items, weights); };
  const auto dense = [&] { return dense_form(in, matrix); };
  const Tensor forms = rotation_forms();
  const auto kernel = [&] { return kernel_form(in, skinning, forms); };
  const auto bones = [&] {
    torch::NoGradGuard no_grad;
    Tensor m = torch::zeros({batch, 70, 3, 4});
    for (int c = 0; c < 3; ++c) m.select(-2, c).select(-1, c).fill_(1.0);
    return m;
  }();
  const Tensor bone_leaf = bones.clone().requires_grad_();
  const auto gradients = [&](const Tensor& output) { return torch::autograd::grad({output}, in.all(), {probe}); };

  const auto expected = gradients(gather()), found = gradients(kernel()), other = gradients(dense());
  std::printf("batch %ld: outputs differ by %.1e (gather) %.1e (dense); gradients to q %.1e, t %.1e, points %.1e\n",
              static_cast<long>(batch), difference(kernel(), gather()), difference(kernel(), dense()),
              difference(tangent(found[0], in.q), tangent(expected[0], in.q)), difference(found[1], expected[1]),
              difference(found[2], expected[2]));
  compare("  forward", {{"gather",
                         [&] {
                           torch::NoGradGuard g;
                           gather();
                         }},
                        {"dense",
                         [&] {
                           torch::NoGradGuard g;
                           dense();
                         }},
                        {"doppel", [&] {
                           torch::NoGradGuard g;
                           kernel();
                         }}});
  compare("  forward + backward",
          {{"gather", [&] { gradients(gather()); }},
           {"dense", [&] { gradients(dense()); }},
           {"doppel, transforms given",
            [&] {
              torch::autograd::grad({skinning->forward(in.points, bone_leaf)}, {in.points, bone_leaf}, {probe});
            }},
           {"doppel", [&] { gradients(kernel()); }}});
}

}  // namespace
}  // namespace doppel::bench

int main(int argc, char** argv) {
  at::set_num_threads(argc > 1 ? std::atoi(argv[1]) : 2);
  const auto body = doppel::bench::make_body();
  for (int64_t batch : {1, 4, 16}) doppel::bench::run(body, batch);
}
