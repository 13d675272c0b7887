#include <gtest/gtest.h>
#include <torch/library.h>
#include <torch/types.h>

#include "doppel/layers/surface.h"
#include "support/test_character.h"

namespace doppel::schemas_test {
namespace {

// Static archives drop object files that only register; the ops stand beside the functions that call them, so whoever
// uses a layer has its ops.
TEST(LayersReference, EveryOpIsInTheDispatcher) {
  const Character actor = make_test_character();
  CharacterSurface surface(actor);
  for (const char* op : {"forward_kinematics", "skinning", "embedded_deformation", "global_alignment"}) {
    for (const char* suffix : {"", "_backward"}) {
      const std::string name = std::string("doppel::") + op + suffix;
      const auto handle = c10::Dispatcher::singleton().findSchema({name, ""});
      ASSERT_TRUE(handle.has_value()) << name;
      EXPECT_TRUE(handle->hasKernelForDispatchKey(c10::DispatchKey::CPU)) << name;
    }
  }
}

}  // namespace
}  // namespace doppel::schemas_test
