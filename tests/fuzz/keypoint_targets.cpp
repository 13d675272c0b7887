#include <fmt/format.h>

#include <cmath>

#include "doppel/core/npy.h"
#include "doppel/detect/keypoints/joint_detections.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/keypoint_table.h"
#include "doppel/detect/keypoints/read_keypoints.h"
#include "doppel/detect/keypoints/read_space_points.h"
#include "fuzz/fuzz_target.h"
#include "io/motion_import/motion_writers.h"

namespace doppel::fuzz {
namespace {

using Path = std::filesystem::path;

const PointLayout kThreePoints{"three", {"nose", "left_knee", "right_knee"}};

KeypointCamera keypoint_camera() {
  KeypointCamera camera;
  camera.index = 0;
  camera.name = "c0";
  camera.width = 640;
  camera.height = 480;
  return camera;
}

void check_points(const Person& person) {
  for (const Keypoint& point : person)
    promise(std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.confidence),
            "keypoints are finite");
}

void read_keypoint_bytes(std::string_view bytes, const Path& folder, const char* name) {
  const Path path = written(bytes, folder, name);
  for (const DetectedImage& image : read_detections(path, keypoint_camera()).images)
    for (const DetectedPerson& person : image.people) {
      check_points(person.body);
      check_points(person.rest);
    }
  std::map<long, People> frames;
  try {
    frames = read_all_people(path, builtin_layouts().at(0), keypoint_camera());
  } catch (const Error&) {
    // The points of another detector.
  }
  for (const auto& [frame, people] : frames)
    for (const Person& person : people) {
      promise(person.size() == builtin_layouts().at(0).points.size(), "people have the points of the layout");
      check_points(person);
    }
}

/// The project's own table, which survives writing and reading.
void read_table_bytes(std::string_view bytes, const Path& folder) {
  const Path path = written(bytes, folder, "a.csv"), again_path = folder / "again.csv";
  const Detections found = read_detections(path, keypoint_camera());
  PointLayout layout{"own", found.points};
  for (const DetectedImage& image : found.images)  // tables with numbers in place of names
    for (const DetectedPerson& person : image.people)
      while (layout.points.size() < person.body.size())
        layout.points.push_back(fmt::format("point {}", layout.points.size()));
  const std::map<long, People> frames = read_all_people(path, layout, keypoint_camera());
  write_keypoint_table(again_path, layout, frames);
  promise(is_keypoint_table(again_path), "a table is recognised");
  const std::map<long, People> again = read_all_people(again_path, layout, keypoint_camera());
  for (const auto& [frame, people] : frames)
    for (std::size_t i = 0; !people.empty() && i < layout.points.size(); ++i) {
      const Keypoint& point = people[0].at(i);
      if (point.confidence < 1e-4F) continue;  // written as 0: not seen
      const Keypoint& other = again.at(frame).at(0).at(i);
      promise(std::abs(other.x - point.x) < 2e-3F && std::abs(other.y - point.y) < 2e-3F &&
                  std::abs(other.confidence - point.confidence) < 1e-4F,
              "points survive");
    }
}

void read_joint_table_bytes(std::string_view bytes, const Path& folder) {
  for (const auto& [frame, joints] : read_joint_detections(written(bytes, folder, "a.csv"), kThreePoints)) {
    promise(joints.size() == kThreePoints.points.size(), "each point has a position");
    for (const JointDetection& joint : joints) promise(joint.position.norm() <= 10, "joints are near the root");
  }
}

void read_map_bytes(std::string_view bytes, const Path& folder) {
  const KeypointMap map = read_keypoint_map(written(bytes, folder, "a.yaml").string());
  promise(!map.layout.points.empty() && !map.entries.empty(), "a map has points and landmarks");
  for (const KeypointMap::Entry& entry : map.entries) {
    promise(map.find(entry.landmark) != nullptr, "landmarks are found");
    for (const int point : entry.points)
      promise(point >= 0 && static_cast<std::size_t>(point) < map.layout.points.size(), "points are in the layout");
  }
}

void read_points_bytes(std::string_view bytes, const Path& folder, const char* name) {
  const SpacePoints points = read_space_points(written(bytes, folder, name));
  for (const auto& [frame, row] : points.frames) {
    promise(row.size() == points.names.size(), "each point has a name");
    for (const auto& seen : row) promise(!seen || seen->allFinite(), "points are finite");
  }
}

constexpr const char* kOpenPose =
    R"({"version":1.3,"people":[{"person_id":[-1],"pose_keypoints_2d":[)"
    "100,200,0.9, 110,210,0.8, 0,0,0, 120,220,0.7, 1,1,1, 2,2,1, 3,3,1, 4,4,1, 5,5,1, 6,6,1, 7,7,1, 8,8,1, 9,9,1,"
    "10,10,1, 11,11,1, 12,12,1, 13,13,1, 14,14,1, 15,15,1, 16,16,1, 17,17,1, 18,18,1, 19,19,1, 20,20,1, 21,21,1]}]}";
constexpr const char* kCoco =
    R"([{"image_id":1,"category_id":1,"score":0.9,"keypoints":[)"
    "1,2,0.5,2,3,0.5,3,4,1,4,5,1,5,6,1,6,7,1,7,8,1,8,9,1,9,10,1,10,11,1,11,12,1,12,13,1,13,14,1,14,15,1,15,16,1,"
    "16,17,1,17,18,1]}]";
constexpr const char* kCocoAnnotations =
    R"({"images":[{"id":7,"file_name":"a_000001.jpg"},{"id":8,"file_name":"a_000002.jpg"}],)"
    R"("categories":[{"id":1,"keypoints":["nose","left_knee","right_knee"]}],)"
    R"("annotations":[{"image_id":7,"keypoints":[1,2,2,3,4,1,0,0,0],"foot_kpts":[5,6,2],"face_kpts":[7,8,2],)"
    R"("lefthand_kpts":[9,9,2],"righthand_kpts":[8,8,0],"num_keypoints":2}]})";
constexpr const char* kMmpose =
    R"([{"frame_id":0,"instances":[{"keypoints":[[100,200],[110,210],[120,220]],"keypoint_scores":[0.9,0.8,0.7],)"
    R"("bbox":[[1,2,300,400]],"bbox_score":0.9}]}])";
constexpr const char* kEasymocap =
    R"({"filename":"a.jpg","height":480,"width":640,"annots":[{"personID":0,"bbox":[1,2,300,400,0.9],)"
    R"("keypoints":[[100,200,0.9],[110,210,0.8],[120,220,0.7]]}]})";
constexpr const char* kAlphapose =
    R"([{"image_id":"1.jpg","category_id":1,"score":2.5,"box":[1,2,3,4],"idx":1,"keypoints":[)"
    "1,2,0.5,2,3,0.5,3,4,1,4,5,1,5,6,1,6,7,1,7,8,1,8,9,1,9,10,1,10,11,1,11,12,1,12,13,1,13,14,1,14,15,1,15,16,1,"
    "16,17,1,17,18,1]}]";
constexpr const char* kDeeplabcut =
    "scorer,net,net,net\nbodyparts,nose,nose,nose\ncoords,x,y,likelihood\n0,100,200,0.9\n1,101,201,0.8\n";
constexpr const char* kWide = "frame,L0_x,L0_y,L1_x,L1_y\n0,10,20,30,40\n1,10,20,30,40\n";
constexpr const char* kTable =
    "frame,name,x,y,confidence\n0,nose,100.5,200,0.9\n0,left_knee,110,210,0.25\n2,nose,101,201,0\n";
constexpr const char* kTableOfCameras =
    "frame,camera,name,x,y,confidence\n0,c0,nose,100.5,200,0.9\n0,c1,nose,9,8,0.5\n1,c0,neck,1,2,1\n";
constexpr const char* kTableOfPoints =
    "x;y;score;frame;person;joint\n100,5;200;0,9;0;1;\"nose\"\n9;8;0,5;0;2;nose\n1;2;1;1;1;\"neck\"\n";
constexpr const char* kTableOfNumbers = "image,landmark_id,x,y\na_1.png,0,100.5,200\na_2.png,1,3,4\n";
constexpr const char* kJointTable =
    "frame,index,name,x_mm,y_mm,z_mm\n0,0,nose,10,-700,20.5\n0,1,left_knee,90,450,0\n3,2,right_knee,-90,450,0\n";
constexpr const char* kMap =
    "points: [nose, left_shoulder, right_shoulder]\nevery_point: true\nlandmarks:\n  nose: nose\n"
    "  neck: [left_shoulder, right_shoulder]\nabsent: [mid_hip]\n";
constexpr const char* kTrc =
    "PathFileType\t4\t(X/Y/Z)\ta.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "100\t100\t2\t2\tmm\t100\t1\t2\nFrame#\tTime\tA\t\t\tB\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
    "1\t0.00\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t4\t5\t6\n";

std::string small_c3d() {
  support::C3dWriter writer;
  writer.labels = {"A", "B"};
  writer.frames = {{{1, 2, 3}, {4, 5, 6}}, {{1, 2, 3}, {NAN, NAN, NAN}}};
  return writer.bytes();
}

void add_keypoints(std::vector<FuzzTarget>& targets) {
  const auto add = [&](const std::string& name, const char* file, const char* seed) {
    targets.push_back(
        {"keypoints_" + name,
         [file](std::string_view bytes, const Path& folder) { read_keypoint_bytes(bytes, folder, file); },
         {seed},
         {"[[[[", "{\"a\":", "null", "1e20", "-1e308", "\"people\":[", "\"keypoints\":[", "nan", ",,,", "\"\""}});
  };
  add("openpose", "a_keypoints.json", kOpenPose);
  add("coco", "a.json", kCoco);
  add("coco_annotations", "a.json", kCocoAnnotations);
  add("mmpose", "a.json", kMmpose);
  add("easymocap", "a.json", kEasymocap);
  add("alphapose", "a.json", kAlphapose);
  add("deeplabcut", "a.csv", kDeeplabcut);
  add("wide", "a.csv", kWide);
  add("points", "a.csv", kTableOfPoints);
  add("numbers", "a.csv", kTableOfNumbers);
  const std::vector<float> row{1, 2, 3, 4};
  static const std::string npy = npy_bytes(row.data(), "<f4", {1, 1, 2, 2});
  targets.push_back({"keypoints_freemocap",
                     [](std::string_view bytes, const Path& folder) { read_keypoint_bytes(bytes, folder, "a.npy"); },
                     {npy},
                     {"'shape': (", "<f8", "(1, 2, 3, 2)"}});
}

}  // namespace

std::vector<FuzzTarget> keypoint_targets() {
  std::vector<FuzzTarget> targets{
      {"points_c3d",
       [](std::string_view bytes, const Path& folder) { read_points_bytes(bytes, folder, "a.c3d"); },
       {small_c3d()},
       {"POINT", "SCALE", "DATA_START", "LABELS", "UNITS"}},
      {"points_trc",
       [](std::string_view bytes, const Path& folder) { read_points_bytes(bytes, folder, "a.trc"); },
       {kTrc},
       {"PathFileType", "nan", "1e300", "\t\t", "NumMarkers"}},
      {"keypoint_table",
       read_table_bytes,
       {kTable, kTableOfCameras, kTableOfPoints, kTableOfNumbers},
       {"frame,camera,name,x,y,confidence", "frame,name,x,y,confidence\n", "c0", "1,nose,1,2,1\n", "1e7", "nan", ",,",
        "\xEF\xBB\xBF", "2147483647", "\r\n"}},
      {"joint_table",
       read_joint_table_bytes,
       {kJointTable},
       {"frame,index,name,x_mm,y_mm,z_mm\n", "1,0,nose,1,2,3\n", "L_Knee", "10000", "nan", ",,", "2147483647"}},
      {"keypoint_map",
       read_map_bytes,
       {kMap, "layout: coco17\nlandmarks: {nose: nose}\n"},
       {"layout: ", "body25", "every_point: true", "absent: [a]", "points: []", "&a [*a]", "*a", "null", "neck: [nose]",
        "landmarks: {}", "!!str "}}};
  add_keypoints(targets);
  return targets;
}

}  // namespace doppel::fuzz
