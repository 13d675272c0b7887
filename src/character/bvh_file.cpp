#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "doppel/character/bvh.h"
#include "doppel/character/file_text.h"
#include "doppel/core/angles.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/config.h"
#include "doppel/core/log.h"
#include "doppel/core/text_reader.h"

namespace doppel {
namespace {

const std::vector<std::string> kChannelNames{"Xposition", "Yposition", "Zposition",
                                             "Xrotation", "Yrotation", "Zrotation"};

/// Joints without channels beyond this number are refused: each of them takes time in each frame, but no bytes.
constexpr std::size_t kFewJoints = 500;

/// Reads the hierarchy as a stream of words, because some writers put braces on separate lines and others do not. Reads
/// the motion line by line.
class BvhReader {
 public:
  explicit BvhReader(const std::filesystem::path& path) : text_(path, "a BVH file") {}

  BvhClip read() {
    text_.require_line("HIERARCHY");
    if (text_.tokens()[0] != "HIERARCHY")
      text_.fail_here("not a BVH file: it must begin with HIERARCHY, found '{}'", excerpt(text_.line()));
    word_ = 1;
    read_hierarchy();
    read_motion();
    return std::move(clip_);
  }

 private:
  /// A joint whose closing brace has not been read yet.
  struct Open {
    int joint;
    bool is_end = false, has_offset = false, has_channels = false, has_child = false;
  };

  /// Moves to the next word, across lines. @return its index in the line
  std::size_t next(const char* expected) {
    while (word_ >= text_.tokens().size()) {
      text_.require_line(expected);
      word_ = 0;
    }
    return word_++;
  }
  std::string_view next_word(const char* expected) {
    const std::size_t token = next(expected);
    return text_.tokens()[token];
  }

  void read_hierarchy() {
    if (const auto word = next_word("ROOT"); word != "ROOT")
      text_.fail_here("HIERARCHY must be followed by ROOT, found '{}'", excerpt(word));
    begin_joint();
    while (!open_.empty()) {
      const auto word = next_word("the end of the hierarchy");
      if (word == "}") {
        end_joint();
      } else if (word == "OFFSET") {
        read_offset();
      } else if (word == "CHANNELS") {
        read_channels();
      } else if (word == "JOINT") {
        begin_joint();
      } else if (word == "End") {
        begin_end_site();
      } else {
        text_.fail_here("found '{}' in joint '{}', where OFFSET, CHANNELS, JOINT, End Site or }} is allowed",
                        excerpt(word), excerpt(joint().name));
      }
    }
    channels_ = as_size(clip_.num_channels());
    if (channels_ == 0) text_.fail_here("no joint of the hierarchy has CHANNELS, so nothing can move");
    if (clip_.joints.size() > kFewJoints + 2 * channels_)
      text_.fail_here("{} joints share {} channels; allowed are twice as many joints as channels, and {} more",
                      clip_.joints.size(), channels_, kFewJoints);
  }

  void begin_joint() {
    if (!open_.empty() && open_.back().is_end) text_.fail_here("an End Site cannot have a JOINT");
    std::string name;
    for (; word_ < text_.tokens().size() && text_.tokens()[word_] != "{"; ++word_)
      name += (name.empty() ? "" : " ") + std::string(text_.tokens()[word_]);
    if (name.empty()) text_.fail_here("a joint without a name");
    add(name, false);
  }

  void begin_end_site() {
    if (next_word("Site") != "Site") text_.fail_here("End must be followed by Site");
    if (open_.back().is_end) text_.fail_here("an End Site within an End Site");
    add(clip_.joints[open_.back().joint].name + "_end", true);
  }

  void add(const std::string& name, bool is_end) {
    const auto [found, is_new] = lines_.emplace(name, text_.where().line);
    if (!is_new)
      text_.fail_here("the name '{}' occurs twice, first in line {}; joint names must be unique", excerpt(name),
                      found->second);
    clip_.joints.push_back({name, open_.empty() ? -1 : open_.back().joint, Eigen::Vector3d::Zero(), {}});
    if (!open_.empty()) open_.back().has_child = true;
    open_.push_back({static_cast<int>(clip_.joints.size()) - 1, is_end});
    if (next_word("{") != "{") text_.fail_here("the joint '{}' must be followed by {{", excerpt(name));
  }

  BvhJoint& joint() { return clip_.joints[open_.back().joint]; }

  void end_joint() {
    if (!open_.back().has_offset) text_.fail_here("the joint '{}' has no OFFSET", excerpt(joint().name));
    open_.pop_back();
  }

  void read_offset() {
    if (std::exchange(open_.back().has_offset, true))
      text_.fail_here("the joint '{}' has a second OFFSET", excerpt(joint().name));
    for (int axis = 0; axis < 3; ++axis) {
      const std::size_t token = next("three numbers");
      joint().offset[axis] = text_.length(token, "offset", 1.0);
    }
  }

  void read_channels() {
    if (open_.back().is_end) text_.fail_here("an End Site cannot have CHANNELS");
    if (std::exchange(open_.back().has_channels, true))
      text_.fail_here("the joint '{}' has a second line of CHANNELS", excerpt(joint().name));
    const std::size_t token = next("the number of channels");
    const long count = text_.integer(token, "number of channels", 0, 6);
    for (long i = 0; i < count; ++i) {
      const std::string word(next_word("the name of a channel"));
      const auto known = std::find(kChannelNames.begin(), kChannelNames.end(), word);
      if (known == kChannelNames.end())
        text_.fail_here("unknown channel '{}'; allowed: {}", excerpt(word), fmt::join(kChannelNames, " "));
      const auto channel = static_cast<BvhChannel>(known - kChannelNames.begin());
      auto& channels = joint().channels;
      if (std::count(channels.begin(), channels.end(), channel) > 0)
        text_.fail_here("the joint '{}' has the channel {} twice", excerpt(joint().name), word);
      channels.push_back(channel);
    }
  }

  void read_motion() {
    if (const auto word = next_word("MOTION"); word != "MOTION")
      text_.fail_here("the hierarchy must be followed by MOTION, found '{}'; a second skeleton cannot be read",
                      excerpt(word));
    text_.require_line("Frames:");
    if (text_.tokens()[0] != "Frames:") text_.fail_here("expected 'Frames: <number>'");
    const std::size_t frames = text_.count(1, "number of frames");
    if (frames == 0) text_.fail_here("the motion has no frames");
    text_.require_line("Frame Time:");
    if (text_.tokens().size() < 3 || text_.tokens()[0] != "Frame" || text_.tokens()[1] != "Time:")
      text_.fail_here("expected 'Frame Time: <seconds>'");
    clip_.seconds_per_frame = text_.number(2, "frame time");
    if (clip_.seconds_per_frame < 1e-4 || clip_.seconds_per_frame > 10.0)
      text_.fail_here("a frame lasts {} seconds; allowed: 0.0001 to 10", clip_.seconds_per_frame);
    for (std::size_t f = 0; f < frames; ++f) read_row(f, frames);
    if (text_.next_line()) text_.fail_here("more lines follow after the {} frames that the file states", frames);
  }

  void read_row(std::size_t frame, std::size_t frames) {
    text_.require_line("a frame");
    if (text_.tokens().size() != channels_)
      text_.fail_here("frame {} of {} has {} numbers, the hierarchy {} channels", frame + 1, frames,
                      text_.tokens().size(), channels_);
    std::vector<double> row(channels_);
    for (std::size_t c = 0; c < channels_; ++c) row[c] = text_.length(c, "channel", 1.0);
    clip_.frames.push_back(std::move(row));
  }

  TextReader text_;
  std::size_t word_ = 0, channels_ = 0;
  BvhClip clip_;
  std::vector<Open> open_;
  std::map<std::string, int> lines_;
};

/// The largest side of the box around the rest pose.
double extent(const BvhClip& clip) {
  std::vector<Eigen::Vector3d> positions;
  Eigen::AlignedBox3d box;
  for (const BvhJoint& joint : clip.joints) {
    // The root's own offset is the position of the person and does not depend on the size.
    positions.push_back(joint.parent < 0 ? Eigen::Vector3d::Zero()
                                         : Eigen::Vector3d(positions[joint.parent] + joint.offset));
    box.extend(positions.back());
  }
  return box.sizes().maxCoeff();
}

double guess_unit(const BvhClip& clip, const std::filesystem::path& path) {
  const double size = extent(clip);
  for (const auto& [metres, name] : {std::pair{1.0, "metres"}, {0.01, "centimetres"}, {0.001, "millimetres"}}) {
    if (size * metres < 0.5 || size * metres > 3.0) continue;
    log::info("{}: the skeleton is {:.3g} units across; the unit is taken as {}", path.string(), size, name);
    return metres;
  }
  fail_at({path.string(), 0},
          "the skeleton is {:.4g} units across; a person is 0.5 to 3 m, so the unit is neither metres, centimetres nor "
          "millimetres. Give the metres per unit (doppel animate: --unit, 0.0254 for inches)",
          size);
}

void to_metres_and_radians(BvhClip& clip, double metres_per_unit) {
  clip.metres_per_unit = metres_per_unit;
  std::vector<double> factors;
  for (BvhJoint& joint : clip.joints) {
    joint.offset *= metres_per_unit;
    for (const BvhChannel channel : joint.channels)
      factors.push_back(is_position(channel) ? metres_per_unit : kRadiansPerDegree);
  }
  for (std::vector<double>& row : clip.frames)
    for (std::size_t c = 0; c < row.size(); ++c) row[c] *= factors[c];
}

/// Writes a hierarchy, from the root downwards. A leaf without an End Site in the clip gets one.
class BvhWriter {
 public:
  BvhWriter(const BvhClip& clip, double metres_per_unit) : clip_(clip), unit_(metres_per_unit) {
    children_.resize(clip.joints.size());
    std::size_t channels = 0;
    for (std::size_t j = 0; j < clip.joints.size(); ++j) {
      const int parent = clip.joints[j].parent;
      if (parent >= static_cast<int>(j) || (parent < 0) != (j == 0))
        fail("a BVH file holds one skeleton with parents before children; joint {} '{}' has the parent {}", j,
             clip.joints[j].name, parent);
      if (parent >= 0) children_[parent].push_back(j);
      first_channel_.push_back(channels);
      channels += clip.joints[j].channels.size();
    }
  }

  std::string text() {
    if (clip_.joints.empty()) fail("a BVH file needs at least one joint");
    text_ = "HIERARCHY\n";
    write_joint(0, 0);
    text_ +=
        fmt::format("MOTION\nFrames: {}\nFrame Time: {}\n", clip_.frames.size(), exact_text(clip_.seconds_per_frame));
    for (const std::vector<double>& row : clip_.frames) write_row(row);
    return text_;
  }

 private:
  void line(int depth, const std::string& content) { text_ += std::string(depth, '\t') + content + "\n"; }

  void write_offset(int depth, const Eigen::Vector3d& metres) {
    const Eigen::Vector3d offset = metres / unit_;
    line(depth, fmt::format("OFFSET {} {} {}", exact_text(offset.x()), exact_text(offset.y()), exact_text(offset.z())));
  }

  void write_end_site(int depth, const Eigen::Vector3d& offset) {
    line(depth, "End Site");
    line(depth, "{");
    write_offset(depth + 1, offset);
    line(depth, "}");
  }

  /// A joint without channels that is the only end of a chain is an End Site; its name is not written.
  bool is_end_site(std::size_t j) const {
    const BvhJoint& joint = clip_.joints[j];
    return joint.parent >= 0 && joint.channels.empty() && children_[j].empty() && children_[joint.parent].size() == 1;
  }

  void write_joint(std::size_t j, int depth) {
    const BvhJoint& joint = clip_.joints[j];
    if (is_end_site(j)) return write_end_site(depth, joint.offset);
    line(depth, (joint.parent < 0 ? "ROOT " : "JOINT ") + joint.name);
    line(depth, "{");
    write_offset(depth + 1, joint.offset);
    std::string channels = fmt::format("CHANNELS {}", joint.channels.size());
    for (const BvhChannel channel : joint.channels) channels += " " + kChannelNames[static_cast<int>(channel)];
    line(depth + 1, channels);
    order_.push_back(j);
    for (const std::size_t child : children_[j]) write_joint(child, depth + 1);
    if (children_[j].empty()) write_end_site(depth + 1, Eigen::Vector3d::Zero());
    line(depth, "}");
  }

  void write_row(const std::vector<double>& row) {
    if (static_cast<int>(row.size()) != clip_.num_channels())
      fail("a frame of this BVH clip has {} channels, received {}", clip_.num_channels(), row.size());
    std::string values;
    for (const std::size_t j : order_) {
      std::size_t c = first_channel_[j];
      for (const BvhChannel channel : clip_.joints[j].channels)
        values +=
            (values.empty() ? "" : " ") + exact_text(row[c++] / (is_position(channel) ? unit_ : kRadiansPerDegree));
    }
    text_ += values + "\n";
  }

  const BvhClip& clip_;
  double unit_;
  std::vector<std::vector<std::size_t>> children_;
  std::vector<std::size_t> first_channel_;
  std::vector<std::size_t> order_;  ///< order of the joints in the file, and of their channels in a row
  std::string text_;
};

}  // namespace

BvhClip read_bvh(const std::filesystem::path& path, std::optional<double> metres_per_unit) {
  BvhClip clip = BvhReader(path).read();
  to_metres_and_radians(clip, metres_per_unit ? *metres_per_unit : guess_unit(clip, path));
  return clip;
}

void write_bvh(const std::filesystem::path& path, const BvhClip& clip, double metres_per_unit) {
  write_atomically(path, BvhWriter(clip, metres_per_unit).text());
}

}  // namespace doppel
