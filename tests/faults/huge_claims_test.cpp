// Small files that claim to be huge: the memory that SECURITY.md promises holds for `doppel` as a whole.

#include <gmock/gmock.h>

#include <functional>
#include <opencv2/imgcodecs.hpp>

#include "faults/program_run.h"
#include "support/gltf_writer.h"
#include "support/hostile_files.h"
#include "support/number_bytes.h"
#include "support/png_writer.h"
#include "support/temporary_folder.h"

namespace doppel::faults {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr long kRefused = 500;  // megabytes: the program itself takes 200, the largest of these files 100

std::string repeated(const std::string& text, int count) {
  std::string all;
  for (int i = 0; i < count; ++i) all += text;
  return all;
}

std::string capture_yaml(const std::string& more) {
  return "doppel_capture: 1\nname: x\nroot: .\ncalibration: c.yml\nfps: 25\n" + more;
}

/// Ten lists, each of which names the one before ten times.
std::string nested_aliases() {
  std::string text = "a0: &a0 [0]\n";
  for (int i = 1; i <= 10; ++i) {
    const std::string before = "*a" + std::to_string(i - 1);
    text += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" + before + repeated(", " + before, 9) + "]\n";
  }
  return text;
}

struct Claim {
  const char* name;
  std::string file;
  std::function<std::string()> content;
  std::string says;  ///< a part of the message that refuses it
};

std::vector<Claim> claims() {
  return {
      {"an image of more than 2^28 pixels", "huge.png",
       [] {
         const std::string side = support::number_bytes(1 << 15, 4, true);
         return "\x89PNG\r\n\x1a\n" + support::png_chunk("IHDR", side + side + std::string("\x8\2\0\0\0", 5));
       },
       "pixels"},
      {"keypoints of 30 million people", "people.json",
       [] { return "{\"people\":[" + repeated("{},", 30'000'000) + "{}]}"; }, "people.json"},
      {"four billion vertices", "scan.ply",
       [] {
         return std::string("ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\n") +
                "property float y\nproperty float z\nend_header\n";
       },
       "4000000000"},
      {"a billion values without a buffer", "scene.glb",
       [] {
         support::GltfWriter scene;
         scene.json["accessors"] = {{{"componentType", 5126}, {"count", 1'000'000'000}, {"type", "VEC3"}}};
         scene.json["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", 0}}}}}}}};
         scene.json["nodes"] = {{{"mesh", 0}}};
         scene.json["scenes"] = {{{"nodes", {0}}}};
         return scene.glb();
       },
       "1000000000"},
      {"two billion frames", "motion.bvh",
       [] {
         return std::string("HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation\n") +
                "End Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\nFrames: 2000000000\nFrame Time: 0.04\n0 0 0\n";
       },
       "2000000000"},
      {"a terabyte of numbers", "numbers.npy",
       [] {
         const std::string text = "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 100000, 3), }\n";
         return std::string("\x93NUMPY\1\0", 8) + static_cast<char>(text.size()) + '\0' + text;
       },
       "1200000000000"},
      {"lists that repeat each other", "capture.yaml", [] { return capture_yaml(nested_aliases()); }, "alias"},
      {"two billion frames of a capture", "capture.yaml",
       [] {
         return capture_yaml(
             "sequences:\n  - {name: a, split: test, videos: 'x{camera}.mp4', last_frame: 2000000000}\n");
       },
       "2000000000"},
  };
}

TEST(HugeClaims, AreRefusedWithoutMuchMemory) {
  for (const Claim& claim : claims()) {
    SCOPED_TRACE(claim.name);
    const support::TemporaryFolder folder;
    support::write_bytes(folder / claim.file, claim.content());
    const Ending ending = run({"info", (folder / claim.file).string()});
    EXPECT_EQ(ending.code, 1) << ending.err;
    EXPECT_THAT(ending.err, HasSubstr(claim.says));
    EXPECT_LT(ending.peak_megabytes, kRefused);
  }
}

/// 0.8 GB for the decoded image, and 1 GB for the halved one in bytes and as floats.
TEST(HugeClaims, ATextureOfTheLargestSizeIsDrawnInTwoGigabytes) {
  const support::TemporaryFolder folder;
  ASSERT_TRUE(run({"synth", "--out", (folder / "capture").string()}).succeeded());
  const fs::path character = folder / "capture" / "character";
  cv::imwrite((character / "actor.png").string(), cv::Mat::zeros(1 << 14, 1 << 14, CV_8UC1),
              {cv::IMWRITE_PNG_COMPRESSION, 1});
  const Ending ending = run({"animate", "--character", (character / "actor.character").string(), "--motion",
                             (character / "actor.motion").string(), "--format", "png", "--video-size", "64", "--out",
                             (folder / "out").string()});
  EXPECT_TRUE(ending.succeeded()) << ending.err;
  EXPECT_LT(ending.peak_megabytes, 2400);
}

}  // namespace
}  // namespace doppel::faults
