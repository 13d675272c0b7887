#include "doppel/nets/lighting.h"

#include <gtest/gtest.h>

namespace doppel::lighting_test {
namespace {

using torch::Tensor;

TEST(Lighting, HasTheMeanForCamerasThatWereNotTrained) {
  const torch::NoGradGuard no_grad;
  Lighting lighting(3, std::vector<int>{0, 2});
  for (int c = 0; c < 3; ++c) lighting->coefficients[c].fill_(c);
  const Tensor found = lighting->forward(torch::tensor({{0, 1, 2, 7}}, torch::kInt64)).select(3, 0).select(2, 0)[0];
  EXPECT_TRUE(torch::equal(found, torch::tensor({0.0f, 1.0f, 2.0f, 1.0f}))) << found;
}

TEST(Lighting, ACaptureWithOtherCamerasNamesItsRows) {
  const torch::NoGradGuard no_grad;
  Lighting lighting(3, std::vector<int>{0, 1, 2});
  for (int c = 0; c < 3; ++c) lighting->coefficients[c].fill_(10 * c);
  lighting->set_rows({2, -1});
  const Tensor found = lighting->forward(torch::tensor({{0, 1, 5}}, torch::kInt64)).select(3, 0).select(2, 0)[0];
  EXPECT_TRUE(torch::equal(found, torch::tensor({20.0f, 10.0f, 10.0f}))) << found;
}

}  // namespace
}  // namespace doppel::lighting_test
