#include "doppel/io/rig_import/landmarks_of_rig.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>

namespace doppel {

namespace {

/// The landmarks without sides, and those of one side in the order of kBodyLandmarks.
enum Middle { kPelvis, kSpine, kChest, kNeck, kHead };
enum Limb { kClavicle, kShoulder, kElbow, kWrist, kHip, kKnee, kAnkle, kToe, kNumLimb };
constexpr int kNumMiddle = 5;

int landmark_index(bool left, int limb) { return kNumMiddle + (left ? 0 : kNumLimb) + limb; }

/// What the name of a joint says: a word without sides, numbers and prefixes, and the side.
struct NameParts {
  std::string word;
  char side = 0;  ///< 'l', 'r' or 0
};

/// Parts of a name between separators, digits and changes from small to capital letters.
std::vector<std::string> split_name(const std::string& name) {
  std::vector<std::string> tokens(1);
  char before = 0;
  for (const char c : name) {
    const bool letter = std::isalpha(static_cast<unsigned char>(c)) != 0;
    const bool capital_after_small =
        std::isupper(static_cast<unsigned char>(c)) && std::islower(static_cast<unsigned char>(before));
    if ((!letter || capital_after_small) && !tokens.back().empty()) tokens.emplace_back();
    if (letter) tokens.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    before = c;
  }
  if (tokens.back().empty()) tokens.pop_back();
  return tokens;
}

NameParts parse_name(const std::string& name) {
  static const std::vector<std::string> kPrefixes{"j",  "bip", "biped", "cc", "base", "def",   "deform", "character",
                                                  "bn", "b",   "c",     "m",  "jnt",  "joint", "bone",   "skel"};
  const std::size_t colon = name.rfind(':');
  NameParts parts;
  for (std::string token : split_name(colon == std::string::npos ? name : name.substr(colon + 1))) {
    // `LeftArm` is two tokens; `leftarm` and `lThigh` are one or two.
    for (const char* side : {"left", "right"})
      if (token.rfind(side, 0) == 0) {
        parts.side = side[0];
        token.erase(0, std::string(side).size());
      }
    if (token == "l" || token == "r") {
      parts.side = token[0];
      continue;
    }
    if (parts.word.empty() && std::find(kPrefixes.begin(), kPrefixes.end(), token) != kPrefixes.end()) continue;
    parts.word += token;
  }
  return parts;
}

/// Words of limbs that mean one landmark in every rig.
const std::map<std::string, Limb>& limb_words() {
  static const std::map<std::string, Limb> kWords{
      {"clavicle", kClavicle}, {"collar", kClavicle},   {"collarbone", kClavicle},
      {"scapula", kClavicle},  {"upperarm", kShoulder}, {"uparm", kShoulder},
      {"arm", kShoulder},      {"humerus", kShoulder},  {"forearm", kElbow},
      {"lowerarm", kElbow},    {"lowarm", kElbow},      {"elbow", kElbow},
      {"hand", kWrist},        {"wrist", kWrist},       {"palm", kWrist},
      {"thigh", kHip},         {"upleg", kHip},         {"upperleg", kHip},
      {"hip", kHip},           {"femur", kHip},         {"leg", kKnee},
      {"lowerleg", kKnee},     {"lowleg", kKnee},       {"shin", kKnee},
      {"calf", kKnee},         {"knee", kKnee},         {"ankle", kAnkle},
      {"toe", kToe},           {"toebase", kToe},       {"toes", kToe},
      {"ball", kToe},          {"football", kToe}};
  return kWords;
}

class LandmarkFinder {
 public:
  explicit LandmarkFinder(const std::vector<RigJoint>& joints) : joints_(joints), children_(joints.size()) {
    found_.fill(-1);
    for (std::size_t j = 0; j < joints.size(); ++j) {
      names_.push_back(parse_name(joints[j].name));
      if (joints[j].parent >= 0) children_[joints[j].parent].push_back(static_cast<int>(j));
    }
  }

  std::array<int, kBodyLandmarks.size()> find() {
    if (joints_.empty()) return found_;
    name_limbs();
    name_middle();
    if (!has_legs() || !has_arms()) find_by_shape();
    find_spine();
    return found_;
  }

 private:
  int& at(bool left, int limb) { return found_[landmark_index(left, limb)]; }
  int at(bool left, int limb) const { return found_[landmark_index(left, limb)]; }
  int parent(int joint) const { return joints_[joint].parent; }
  const Eigen::Vector3d& position(int joint) const { return joints_[joint].position; }
  bool below(int joint, int ancestor) const {
    for (; joint >= 0; joint = parent(joint))
      if (joint == ancestor) return true;
    return false;
  }
  bool has_legs() const {
    return at(true, kHip) >= 0 && at(true, kKnee) >= 0 && at(false, kHip) >= 0 && at(false, kKnee) >= 0;
  }
  bool has_arms() const {
    return at(true, kShoulder) >= 0 && at(true, kElbow) >= 0 && at(false, kShoulder) >= 0 && at(false, kElbow) >= 0;
  }

  /// The first joint of a side with a word, which is the nearest to the root among several (`shoulder01`).
  int first(char side, const std::string& word) const {
    for (std::size_t j = 0; j < joints_.size(); ++j)
      if (names_[j].side == side && names_[j].word == word) return static_cast<int>(j);
    return -1;
  }

  void name_limbs();
  void name_middle();
  void find_by_shape();
  void find_spine();
  std::vector<int> path(int from, int to) const;
  std::vector<int> leaves() const;
  void set_leg(bool left, const std::vector<int>& joints);
  void set_arm(bool left, std::vector<int> joints);
  bool is_left(const Eigen::Vector3d& offset, const Eigen::Vector3d& forward) const {
    return Eigen::Vector3d::UnitY().cross(forward).dot(offset) > 0;
  }

  const std::vector<RigJoint>& joints_;
  std::vector<std::vector<int>> children_;
  std::vector<NameParts> names_;
  std::array<int, kBodyLandmarks.size()> found_{};
};

void LandmarkFinder::name_limbs() {
  for (const bool left : {true, false}) {
    const char side = left ? 'l' : 'r';
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      const auto word = limb_words().find(names_[j].word);
      if (names_[j].side != side || word == limb_words().end()) continue;
      int& joint = at(left, word->second);
      if (joint < 0) joint = static_cast<int>(j);
    }
    // A shoulder is the clavicle where an upper arm follows, else the shoulder itself.
    if (const int shoulder = first(side, "shoulder"); shoulder >= 0) {
      if (at(left, kShoulder) >= 0 && at(left, kClavicle) < 0)
        at(left, kClavicle) = shoulder;
      else if (at(left, kShoulder) < 0)
        at(left, kShoulder) = shoulder;
    }
    // A foot is the ankle, or the toes where there is an ankle too.
    if (const int foot = first(side, "foot"); foot >= 0) {
      if (at(left, kAnkle) < 0)
        at(left, kAnkle) = foot;
      else if (at(left, kToe) < 0)
        at(left, kToe) = foot;
    }
    // `Leg` is the whole leg where nothing else is a thigh.
    if (at(left, kHip) < 0 && first(side, "leg") >= 0 && first(side, "leg") != at(left, kKnee))
      at(left, kHip) = first(side, "leg");
  }
}

void LandmarkFinder::name_middle() {
  for (const char* word : {"hips", "hip", "pelvis"})
    if (found_[kPelvis] < 0) found_[kPelvis] = first(0, word);
  found_[kNeck] = first(0, "neck");
  found_[kHead] = first(0, "head");
}

std::vector<int> LandmarkFinder::path(int from, int to) const {
  std::vector<int> joints;
  for (int j = to; j >= 0 && j != from; j = parent(j)) joints.push_back(j);
  std::reverse(joints.begin(), joints.end());
  return joints;
}

std::vector<int> LandmarkFinder::leaves() const {
  std::vector<int> result;
  for (std::size_t j = 0; j < joints_.size(); ++j)
    if (children_[j].empty()) result.push_back(static_cast<int>(j));
  return result;
}

void LandmarkFinder::set_leg(bool left, const std::vector<int>& joints) {
  for (std::size_t i = 0; i < 4 && i < joints.size(); ++i) at(left, kHip + static_cast<int>(i)) = joints[i];
}

/// The joints from the chest to the hand, where fingers spread or the chain ends.
void LandmarkFinder::set_arm(bool left, std::vector<int> joints) {
  for (std::size_t i = 2; i < joints.size(); ++i)
    if (children_[joints[i]].size() > 1) {
      joints.resize(i + 1);
      break;
    }
  const int first_limb = joints.size() >= 4 ? kClavicle : kShoulder;
  for (std::size_t i = 0; i < joints.size() && first_limb + static_cast<int>(i) <= kWrist; ++i)
    at(left, first_limb + static_cast<int>(i)) = joints[i];
}

/// Two legs are the paths from a common joint to the lowest leaves on both sides, the head is the highest leaf, arms
/// are the paths to the leaves that reach farthest to the sides.
void LandmarkFinder::find_by_shape() {
  std::vector<int> ends = leaves();
  if (ends.size() < 5) return;
  std::sort(ends.begin(), ends.end(), [&](int a, int b) { return position(a).y() < position(b).y(); });
  const int foot = ends[0], head = ends.back();
  const auto meeting = [&](int a, int b) {
    while (a >= 0 && !below(b, a)) a = parent(a);
    return a;
  };
  // The other foot is the next lowest leaf that does not share the first one's ankle.
  int other = -1, pelvis = -1;
  for (std::size_t i = 1; i < ends.size() && other < 0; ++i) {
    const int together = meeting(foot, ends[i]);
    if (together < 0 || !below(head, together) || path(together, ends[i]).size() < 3) continue;
    other = ends[i];
    pelvis = together;
  }
  if (other < 0) return;
  const std::vector<int> leg = path(pelvis, foot), second = path(pelvis, other);
  if (leg.size() < 3 || second.size() < 3) return;
  // Forward is where the feet point; up is y.
  const auto across = [](Eigen::Vector3d v) { return Eigen::Vector3d(v.x(), 0, v.z()); };
  Eigen::Vector3d forward = Eigen::Vector3d::UnitZ();
  if (leg.size() > 3 && second.size() > 3) {
    const Eigen::Vector3d feet =
        across(position(leg[3]) - position(leg[2]) + position(second[3]) - position(second[2]));
    if (feet.norm() > 1e-9) forward = feet.normalized();
  }
  const bool first_left = is_left(position(leg[0]) - position(second[0]), forward);
  set_leg(first_left, leg);
  set_leg(!first_left, second);
  found_[kPelvis] = pelvis;

  const Eigen::Vector3d left_way = Eigen::Vector3d::UnitY().cross(forward);
  int hand[2] = {-1, -1};
  for (const bool left : {true, false})
    for (const int end : ends) {
      if (below(end, leg[0]) || below(end, second[0]) || end == head) continue;
      const auto reach = [&](int joint) { return (left ? 1 : -1) * left_way.dot(position(joint) - position(pelvis)); };
      int& best = hand[left ? 1 : 0];
      if (best < 0 || reach(end) > reach(best)) best = end;
    }
  const int chest = hand[0] >= 0 && hand[1] >= 0 ? meeting(hand[0], hand[1]) : -1;
  if (chest < 0 || !below(head, chest)) return;
  set_arm(true, path(chest, hand[1]));
  set_arm(false, path(chest, hand[0]));
  const std::vector<int> up = path(chest, head);
  if (found_[kNeck] < 0 && !up.empty()) found_[kNeck] = up[0];
  if (found_[kHead] < 0 && up.size() > 1) found_[kHead] = up[1];
}

/// The pelvis where no name says it, and the first and last joint between pelvis and neck.
void LandmarkFinder::find_spine() {
  if (found_[kPelvis] < 0 && at(true, kHip) >= 0 && at(false, kHip) >= 0) {
    int joint = at(true, kHip);
    while (joint >= 0 && !below(at(false, kHip), joint)) joint = parent(joint);
    found_[kPelvis] = joint;
  }
  int top = found_[kNeck] >= 0 ? parent(found_[kNeck]) : found_[kHead] >= 0 ? parent(found_[kHead]) : -1;
  if (top < 0 && at(true, kShoulder) >= 0 && at(false, kShoulder) >= 0) {
    top = at(true, kShoulder);
    while (top >= 0 && !below(at(false, kShoulder), top)) top = parent(top);
  }
  // `neck02` and the like stand between; the chain ends where the arms begin.
  std::vector<int> chain;
  for (int j = top; j >= 0 && j != found_[kPelvis]; j = parent(j)) chain.push_back(j);
  if (found_[kPelvis] >= 0 && top >= 0 && !below(top, found_[kPelvis])) {
    // The pelvis is beside the spine (a joint of its own for the hips): the chain ends below their common parent.
    while (!chain.empty() && below(found_[kPelvis], chain.back())) chain.pop_back();
  }
  if (chain.empty()) return;
  found_[kSpine] = chain.back();
  found_[kChest] = chain.front();
}

}  // namespace

std::array<int, kBodyLandmarks.size()> find_landmarks(const std::vector<RigJoint>& joints) {
  return LandmarkFinder(joints).find();
}

}  // namespace doppel
