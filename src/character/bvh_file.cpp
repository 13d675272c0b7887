#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "doppel/character/bvh.h"
#include "doppel/character/file_text.h"
#include "doppel/core/angles.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/config.h"
#include "doppel/core/log.h"
#include "doppel/core/lower_case.h"
#include "doppel/core/text_reader.h"

namespace doppel {
namespace {

const std::vector<std::string> kChannelNames{"Xposition", "Yposition", "Zposition",
                                             "Xrotation", "Yrotation", "Zrotation"};
/// Channels that some programs add to each joint. Bones keep their lengths here, so their values must be 1.
const std::vector<std::string> kScaleNames{"Xscale", "Yscale", "Zscale"};
constexpr double kNoScale = 1e-3;  ///< a scale that is nearer to 1 changes nothing

/// Joints without channels beyond this number are refused: each of them takes time in each frame, but no bytes.
constexpr std::size_t kFewJoints = 500;
constexpr long kMaxFrames = 10'000'000;

/// Reads the hierarchy as a stream of words, because some writers put braces on separate lines and others do not. Reads
/// the motion line by line. Programs spell the words of the format in upper and lower case; names of joints are taken
/// as they are written.
class BvhReader {
 public:
  explicit BvhReader(const std::filesystem::path& path) : text_(path, "a BVH file") {}

  BvhClip read() {
    text_.require_line("HIERARCHY");
    if (!is(text_.tokens()[0], "hierarchy"))
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
    int end_sites = 0;
  };

  static bool is(std::string_view word, std::string_view lower) { return lower_case(std::string(word)) == lower; }

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
    if (const auto word = next_word("ROOT"); !is(word, "root"))
      text_.fail_here("HIERARCHY must be followed by ROOT, found '{}'", excerpt(word));
    begin_joint();
    while (!open_.empty()) {
      const auto word = next_word("the end of the hierarchy");
      if (word == "}") {
        end_joint();
      } else if (is(word, "offset")) {
        read_offset();
      } else if (is(word, "channels")) {
        read_channels();
      } else if (is(word, "joint")) {
        begin_joint();
      } else if (is(word, "end")) {
        begin_end_site();
      } else {
        text_.fail_here("found '{}' in joint '{}', where OFFSET, CHANNELS, JOINT, End Site or }} is allowed",
                        excerpt(word), excerpt(joint().name));
      }
    }
    if (is_scale_.empty()) text_.fail_here("no joint of the hierarchy has CHANNELS, so nothing can move");
    if (clip_.joints.size() > kFewJoints + 2 * is_scale_.size())
      text_.fail_here("{} joints share {} channels; allowed are twice as many joints as channels, and {} more",
                      clip_.joints.size(), is_scale_.size(), kFewJoints);
  }

  void begin_joint() {
    if (!open_.empty() && open_.back().is_end) text_.fail_here("an End Site cannot have a JOINT");
    std::string name;
    for (; word_ < text_.tokens().size() && text_.tokens()[word_] != "{"; ++word_)
      name += (name.empty() ? "" : " ") + std::string(text_.tokens()[word_]);
    if (name.empty()) text_.fail_here("a joint without a name");
    add(name, false);
  }

  /// Some programs give an End Site a name, which says no more than that of its joint.
  void begin_end_site() {
    if (!is(next_word("Site"), "site")) text_.fail_here("End must be followed by Site");
    while (word_ < text_.tokens().size() && text_.tokens()[word_] != "{") ++word_;
    if (open_.back().is_end) text_.fail_here("an End Site within an End Site");
    const int count = ++open_.back().end_sites;
    add(clip_.joints[open_.back().joint].name + "_end" + (count > 1 ? std::to_string(count) : ""), true);
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
    const long count = text_.integer(token, "number of channels", 0, 9);
    std::set<std::string> seen;
    for (long i = 0; i < count; ++i) {
      const std::string word(next_word("the name of a channel"));
      const std::size_t known = channel_of(word);
      if (!seen.insert(lower_case(word)).second)
        text_.fail_here("the joint '{}' has the channel {} twice", excerpt(joint().name), word);
      is_scale_.push_back(known >= kChannelNames.size());
      if (!is_scale_.back()) joint().channels.push_back(static_cast<BvhChannel>(known));
    }
  }

  /// The index among the channels that move a joint, followed by the scales.
  std::size_t channel_of(const std::string& word) const {
    std::vector<std::string> all = kChannelNames;
    all.insert(all.end(), kScaleNames.begin(), kScaleNames.end());
    const auto known = std::find_if(all.begin(), all.end(),
                                    [&](const std::string& name) { return lower_case(name) == lower_case(word); });
    if (known == all.end()) text_.fail_here("unknown channel '{}'; allowed: {}", excerpt(word), fmt::join(all, " "));
    return as_size(known - all.begin());
  }

  void read_motion() {
    if (const auto word = next_word("MOTION"); !is(word, "motion"))
      text_.fail_here("the hierarchy must be followed by MOTION, found '{}'; a second skeleton cannot be read",
                      excerpt(word));
    const double frames = read_header("frames", "Frames: <number>");
    if (!(frames >= 1 && frames <= static_cast<double>(kMaxFrames) && frames == std::floor(frames)))
      text_.fail_here("the number of frames is {}; allowed is a whole number from 1 to {}", frames, kMaxFrames);
    clip_.seconds_per_frame = read_header("frametime", "Frame Time: <seconds>");
    if (!(clip_.seconds_per_frame >= 1e-4 && clip_.seconds_per_frame <= 10.0))
      text_.fail_here("a frame lasts {} seconds; allowed: 0.0001 to 10", clip_.seconds_per_frame);
    const auto count = static_cast<std::size_t>(frames);
    for (std::size_t f = 0; f < count; ++f) read_row(f, count);
    if (text_.next_line()) text_.fail_here("more lines follow after the {} frames that the file states", count);
  }

  /// The number in the next line, which is `<key>: <number>` with or without blanks.
  /// @param key in lower case, without blanks
  double read_header(std::string_view key, const char* expected) {
    text_.require_line(expected);
    const std::string_view line = text_.line();
    const std::size_t colon = line.find(':');
    std::string found = lower_case(std::string(line.substr(0, colon)));
    std::erase_if(found, [](char c) { return c == ' ' || c == '\t'; });
    std::string_view value = colon == std::string_view::npos ? "" : line.substr(colon + 1);
    value.remove_prefix(std::min(value.find_first_not_of(" \t"), value.size()));
    const std::optional<double> number = parse_number(value);
    if (found != key || !number) text_.fail_here("expected '{}', found '{}'", expected, excerpt(line));
    return *number;
  }

  void read_row(std::size_t frame, std::size_t frames) {
    text_.require_line("a frame");
    if (text_.tokens().size() != is_scale_.size())
      text_.fail_here("frame {} of {} has {} numbers, the hierarchy {} channels", frame + 1, frames,
                      text_.tokens().size(), is_scale_.size());
    std::vector<double> row;
    for (std::size_t c = 0; c < is_scale_.size(); ++c) {
      const double value = text_.length(c, "channel", 1.0);
      if (!is_scale_[c])
        row.push_back(value);
      else if (std::abs(value - 1.0) > kNoScale)
        text_.fail_here(
            "frame {} of {} scales a joint by {}; bones keep their lengths here, so only the scale 1 is read. Bake the "
            "scales in the program that wrote the file, or export it without them",
            frame + 1, frames, value);
    }
    clip_.frames.push_back(std::move(row));
  }

  TextReader text_;
  std::size_t word_ = 0;
  std::vector<bool> is_scale_;  ///< of each number in a row
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
