#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/view/view_mesh.h"
#include "doppel/view/view_server.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::view_test {
namespace {

using support::message_of;
using ::testing::HasSubstr;

TEST(ViewMeshBehaves, VerticesAreSplitWhereTheirUvsDiffer) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  EXPECT_EQ(split_at_seams(mesh).source.size(), 4U);
  mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0.5, 0.5}};
  mesh.face_uvs = {{0, 1, 2}, {4, 2, 3}};
  const ViewMesh split = split_at_seams(mesh);
  EXPECT_EQ(split.source, (std::vector<std::uint32_t>{0, 1, 2, 0, 3}));
  EXPECT_EQ(split.corners, (std::vector<std::uint32_t>{0, 1, 2, 3, 2, 4}));
  EXPECT_EQ(split.uvs[6], 0.5f);
}

TEST(ViewErrors, OtherTargetsAndTakenPorts) {
  EXPECT_THAT(message_of([] { open_view_subject("/no/such/thing"); }), HasSubstr("neither a run"));
  EXPECT_THAT(message_of([] { open_view_subject("/no/such/actor.pt"); }), HasSubstr("--character"));
  ViewSubject subject;
  subject.character = make_test_character();
  subject.motion = {{subject.character.rest_dofs}, {0}};
  ViewServer server(subject, 0);
  const std::string port = server.url().substr(17, server.url().find("/?") - 17);
  EXPECT_THAT(message_of([&] { ViewServer(subject, std::stoi(port)); }), HasSubstr("is taken"));
}

}  // namespace
}  // namespace doppel::view_test
