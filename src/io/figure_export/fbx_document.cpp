#include "doppel/io/figure_export/fbx_document.h"

#include <cmath>
#include <map>
#include <string_view>

#include "doppel/io/scene/fbx_animation.h"

namespace doppel {
namespace {

constexpr std::int64_t kFirstId = 1'000'000, kDocumentId = 999'999;
constexpr int kFbxVersion = 7400;
/// Readers of Autodesk check the id of the file, its time of creation and its footer (fbx_records.cpp) against each
/// other. These three fit.
constexpr const char* kCreated = "1970-01-01 10:00:00:000";
constexpr std::string_view kFileId("\x28\xb3\x2a\xeb\xb6\x24\xcc\xc2\xbf\xc8\xb0\x2a\xa9\x2b\xfc\xf1", 16);
constexpr int kOwnRate = 14;

const std::map<double, int>& rate_modes() {
  static const std::map<double, int> all{{24, 11},
                                         {25, 10},
                                         {30, 6},
                                         {48, 5},
                                         {50, 4},
                                         {60, 3},
                                         {72, 16},
                                         {96, 15},
                                         {100, 2},
                                         {120, 1},
                                         {1000, 12},
                                         {24000 / 1001.0, 13},
                                         {30000 / 1001.0, 9},
                                         {60000 / 1001.0, 17}};
  return all;
}

FbxNode number_record(const std::string& name, std::int32_t number) { return {name, {number}, {}}; }

FbxNode fbx_header() {
  FbxNode stamp{"CreationTimeStamp", {}, {number_record("Version", 1000)}};
  const std::vector<std::pair<const char*, int>> parts{{"Year", 1970}, {"Month", 1},  {"Day", 1},        {"Hour", 10},
                                                       {"Minute", 0},  {"Second", 0}, {"Millisecond", 0}};
  for (const auto& [name, value] : parts) stamp.children.push_back(number_record(name, value));
  return {"FBXHeaderExtension",
          {},
          {number_record("FBXHeaderVersion", 1003),
           number_record("FBXVersion", kFbxVersion),
           number_record("EncryptionType", 0),
           std::move(stamp),
           {"Creator", {"Doppel"}, {}}}};
}

/// Metres are 100 units, y points up, z to the front, and x to the left of who looks along z.
FbxNode fbx_settings(const FbxClock& clock) {
  const auto whole = [](const char* name, int value) { return property70(name, "int", "Integer", "", {value}); };
  const auto real = [](const char* name, double value) { return property70(name, "double", "Number", "", {value}); };
  const auto time = [&](const char* name, int frame) {
    return property70(name, "KTime", "Time", "", {clock.ticks(frame)});
  };
  return {"GlobalSettings",
          {},
          {number_record("Version", 1000),
           properties70({whole("UpAxis", 1), whole("UpAxisSign", 1), whole("FrontAxis", 2), whole("FrontAxisSign", 1),
                         whole("CoordAxis", 0), whole("CoordAxisSign", 1), whole("OriginalUpAxis", 1),
                         whole("OriginalUpAxisSign", 1), real("UnitScaleFactor", 100.0 / kFbxUnitsPerMetre),
                         real("OriginalUnitScaleFactor", 100.0 / kFbxUnitsPerMetre),
                         property70("TimeMode", "enum", "", "", {clock.mode()}), time("TimeSpanStart", 0),
                         time("TimeSpanStop", clock.last_frame),
                         real("CustomFrameRate", clock.own_rate() ? clock.frames_per_second : -1.0)})}};
}

FbxNode fbx_documents(const std::string& animation) {
  return {"Documents",
          {},
          {number_record("Count", 1),
           {"Document",
            {kDocumentId, "Scene", "Scene"},
            {properties70({property70("SourceObject", "object", "", "", {}),
                           property70("ActiveAnimStackName", "KString", "", "", {animation})}),
             {"RootNode", {std::int64_t{0}}, {}}}}}};
}

FbxNode fbx_definitions(const std::vector<FbxNode>& objects) {
  std::map<std::string, int> counts{{"GlobalSettings", 1}};
  for (const FbxNode& object : objects) ++counts[object.name];
  FbxNode result{
      "Definitions", {}, {number_record("Version", 100), number_record("Count", static_cast<int>(objects.size()) + 1)}};
  for (const auto& [name, count] : counts)
    result.children.push_back({"ObjectType", {name}, {number_record("Count", count)}});
  return result;
}

FbxNode fbx_takes(const FbxClock& clock, const std::string& animation) {
  FbxNode result{"Takes", {}, {{"Current", {animation}, {}}}};
  if (animation.empty()) return result;
  const std::vector<FbxNode::Value> span{clock.ticks(0), clock.ticks(clock.last_frame)};
  result.children.push_back(
      {"Take",
       {animation},
       {{"FileName", {animation + ".tak"}, {}}, {"LocalTime", span, {}}, {"ReferenceTime", span, {}}}});
  return result;
}

}  // namespace

FbxNode property70(const std::string& name, const std::string& type, const std::string& label, const std::string& flags,
                   std::vector<FbxNode::Value> values) {
  FbxNode property{"P", {name, type, label, flags}, {}};
  property.values.insert(property.values.end(), values.begin(), values.end());
  return property;
}

FbxNode properties70(std::vector<FbxNode> properties) { return {"Properties70", {}, std::move(properties)}; }

std::int64_t FbxClock::ticks(double frame) const {
  return std::llround(frame / frames_per_second * kFbxTicksPerSecond);
}

int FbxClock::mode() const {
  for (const auto& [rate, mode] : rate_modes())
    if (std::abs(rate - frames_per_second) < 0.002) return mode;
  return kOwnRate;
}

bool FbxClock::own_rate() const { return mode() == kOwnRate; }

std::int64_t FbxDocument::add(const std::string& record, const std::string& name, const std::string& kind,
                              const std::string& type, std::vector<FbxNode> children) {
  const std::int64_t id = kFirstId + static_cast<std::int64_t>(objects_.size());
  objects_.push_back({record, {id, fbx_object_name(name, kind), type}, std::move(children)});
  return id;
}

void FbxDocument::connect(std::int64_t lower, std::int64_t upper) {
  connections_.push_back({"C", {"OO", lower, upper}, {}});
}

void FbxDocument::connect(std::int64_t lower, std::int64_t upper, const std::string& property) {
  connections_.push_back({"C", {"OP", lower, upper, property}, {}});
}

FbxNode FbxDocument::root(const FbxClock& clock, const std::string& animation) const {
  return {"",
          {},
          {fbx_header(),
           {"FileId", {FbxBytes{std::string(kFileId)}}, {}},
           {"CreationTime", {kCreated}, {}},
           {"Creator", {"Doppel"}, {}},
           fbx_settings(clock),
           fbx_documents(animation),
           {"References", {}, {}},
           fbx_definitions(objects_),
           {"Objects", {}, objects_},
           {"Connections", {}, connections_},
           fbx_takes(clock, animation)}};
}

}  // namespace doppel
