#include "doppel/core/lmdb_file.h"

#include <cstdint>
#include <cstring>
#include <fstream>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {

namespace {

// The on-disk format of LMDB 0.9 (data version 1), little-endian, 64 bit.
constexpr std::uint32_t kLmdbMagic = 0xBEEFC0DE;
constexpr std::uint32_t kDataVersion = 1;
constexpr std::size_t kPageHead = 16, kNodeHead = 8, kMetaBytes = 136;
constexpr std::uint64_t kNoPage = ~std::uint64_t{0};
constexpr std::uint16_t kBranch = 0x01, kLeaf = 0x02, kOverflow = 0x04, kMeta = 0x08;
constexpr std::uint16_t kBigData = 0x01;
constexpr std::uint16_t kIntegerKeys = 0x08;
constexpr int kMaxTreeDepth = 32;

template <typename T>
T load(const std::uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  return value;
}

struct Tree {
  std::uint16_t flags, depth;
  std::uint64_t root;
};

struct Meta {
  std::uint32_t page_size = 0;
  Tree free, main;
  std::uint64_t last_page = 0, transaction = 0;
};

class PageChecker {
 public:
  explicit PageChecker(const std::filesystem::path& path)
      : path_(path.string()), file_(path, std::ios::binary), bytes_(std::filesystem::file_size(path)) {
    if (!file_) damaged("it cannot be read");
  }

  void check() {
    const Meta first = read_meta(0);
    const Meta second = read_meta(first.page_size);
    if (first.page_size != second.page_size) damaged("its two heads have different page sizes");
    const Meta& meta = second.transaction > first.transaction ? second : first;
    page_size_ = meta.page_size;
    last_page_ = meta.last_page;
    if (last_page_ > (bytes_ / page_size_) || (last_page_ + 1) * page_size_ > bytes_)
      damaged(fmt::format("it is truncated: {} bytes of {}", bytes_, (last_page_ + 1) * page_size_));
    check_tree(meta.free, kIntegerKeys);
    check_tree(meta.main, 0);
  }

 private:
  [[noreturn]] void damaged(const std::string& what) const {
    fail_at({path_, 0}, "the store is damaged: {}; prepare the capture again with --overwrite", what);
  }

  void read(std::uint64_t offset, std::size_t count, std::vector<std::uint8_t>& into) {
    into.resize(count);
    if (offset + count > bytes_ || !file_.seekg(static_cast<std::streamoff>(offset)) ||
        !file_.read(reinterpret_cast<char*>(into.data()), static_cast<std::streamsize>(count)))
      damaged("it ends too early");
  }

  static Tree read_tree(const std::uint8_t* at) {
    return {load<std::uint16_t>(at + 4), load<std::uint16_t>(at + 6), load<std::uint64_t>(at + 40)};
  }

  Meta read_meta(std::uint64_t offset) {
    std::vector<std::uint8_t> page;
    read(offset, kPageHead + kMetaBytes, page);
    const std::uint8_t* at = page.data() + kPageHead;
    if (load<std::uint16_t>(page.data() + 10) != kMeta || load<std::uint32_t>(at) != kLmdbMagic)
      damaged("it does not begin as an LMDB file");
    if (load<std::uint32_t>(at + 4) != kDataVersion) damaged("it was written by another version of LMDB");
    Meta meta;
    meta.page_size = load<std::uint32_t>(at + 24);
    meta.free = read_tree(at + 24);
    meta.main = read_tree(at + 72);
    meta.last_page = load<std::uint64_t>(at + 120);
    meta.transaction = load<std::uint64_t>(at + 128);
    if (meta.page_size < 512 || meta.page_size > 65536 || (meta.page_size & (meta.page_size - 1)) != 0)
      damaged("its page size is impossible");
    return meta;
  }

  void check_tree(const Tree& tree, std::uint16_t flags) {
    if (tree.flags != flags) damaged("a tree has unknown flags");
    if (tree.depth > kMaxTreeDepth) damaged("a tree is too deep");
    lists_free_pages_ = (flags & kIntegerKeys) != 0;
    if (tree.root != kNoPage) check_page(tree.root, tree.depth);
  }

  /// @param depth remaining levels, including this page
  void check_page(std::uint64_t number, int depth) {
    if (depth <= 0 || number < 2 || number > last_page_ || ++visited_ > last_page_)
      damaged(fmt::format("page {} cannot be part of the tree", number));
    std::vector<std::uint8_t> page;
    read(number * page_size_, page_size_, page);
    const std::uint16_t kind = load<std::uint16_t>(page.data() + 10);
    const std::size_t lower = load<std::uint16_t>(page.data() + 12), upper = load<std::uint16_t>(page.data() + 14);
    const bool leaf = depth == 1;
    if (load<std::uint64_t>(page.data()) != number || kind != (leaf ? kLeaf : kBranch) || lower < kPageHead ||
        lower > upper || upper > page_size_)
      damaged(fmt::format("the head of page {} is wrong", number));
    const std::size_t nodes = (lower - kPageHead) / 2;
    if (nodes < (leaf ? 1u : 2u)) damaged(fmt::format("page {} is empty", number));
    for (std::size_t i = 0; i < nodes; ++i) {
      const std::size_t at = load<std::uint16_t>(page.data() + kPageHead + 2 * i);
      if (at < upper || at + kNodeHead > page_size_)
        damaged(fmt::format("a node of page {} lies outside of it", number));
      leaf ? check_leaf_node(page, at, number) : check_branch_node(page, at, number, depth);
    }
  }

  void check_leaf_node(const std::vector<std::uint8_t>& page, std::size_t at, std::uint64_t number) {
    const std::uint8_t* node = page.data() + at;
    const std::uint64_t size = load<std::uint16_t>(node) | std::uint64_t{load<std::uint16_t>(node + 2)} << 16;
    const std::uint16_t flags = load<std::uint16_t>(node + 4);
    const std::size_t key = load<std::uint16_t>(node + 6);
    if (flags & ~kBigData) damaged(fmt::format("a node of page {} has unknown flags", number));
    const std::size_t stored = flags & kBigData ? sizeof(std::uint64_t) : size;
    if (at + kNodeHead + key + stored > page_size_)
      damaged(fmt::format("a node of page {} is longer than the page", number));
    if (lists_free_pages_ && key != sizeof(std::uint64_t)) damaged("a key of the free pages has another length");
    if (!(flags & kBigData)) {
      if (lists_free_pages_) check_free_pages(node + kNodeHead + key, size);
      return;
    }
    const auto first = load<std::uint64_t>(node + kNodeHead + key);
    const std::uint64_t pages = (kPageHead - 1 + size) / page_size_ + 1;
    if (first < 2 || first > last_page_ || pages > last_page_ + 1 - first)
      damaged(fmt::format("a value of page {} lies outside of the file", number));
    check_value_pages(first, pages, size);
  }

  /// LMDB frees as many pages of a long value as stand in the head of the first of them.
  void check_value_pages(std::uint64_t first, std::uint64_t pages, std::uint64_t size) {
    std::vector<std::uint8_t> head;
    read(first * page_size_, kPageHead, head);
    const std::uint64_t stated = load<std::uint32_t>(head.data() + 12);
    if (load<std::uint64_t>(head.data()) != first || load<std::uint16_t>(head.data() + 10) != kOverflow ||
        stated < pages || stated > last_page_ + 1 - first)
      damaged(fmt::format("the head of page {} is wrong", first));
    if (!lists_free_pages_) return;
    std::vector<std::uint8_t> list;
    read(first * page_size_ + kPageHead, size, list);
    check_free_pages(list.data(), size);
  }

  /// A list of pages that a writer may use: their number, then the pages in descending order. LMDB trusts them.
  void check_free_pages(const std::uint8_t* list, std::uint64_t size) const {
    constexpr std::uint64_t kWord = sizeof(std::uint64_t);
    if (size < kWord || size % kWord != 0 || load<std::uint64_t>(list) != size / kWord - 1)
      damaged("a list of free pages has another length than it states");
    std::uint64_t before = last_page_ + 1;
    for (std::uint64_t at = kWord; at < size; at += kWord) {
      const auto page = load<std::uint64_t>(list + at);
      if (page < 2 || page >= before) damaged(fmt::format("page {} cannot be free", page));
      before = page;
    }
  }

  void check_branch_node(const std::vector<std::uint8_t>& page, std::size_t at, std::uint64_t number, int depth) {
    const std::uint8_t* node = page.data() + at;
    const std::uint64_t child = load<std::uint16_t>(node) | std::uint64_t{load<std::uint16_t>(node + 2)} << 16 |
                                std::uint64_t{load<std::uint16_t>(node + 4)} << 32;
    if (at + kNodeHead + load<std::uint16_t>(node + 6) > page_size_)
      damaged(fmt::format("a node of page {} is longer than the page", number));
    check_page(child, depth - 1);
  }

  std::string path_;
  std::ifstream file_;
  std::uint64_t bytes_, page_size_ = 0, last_page_ = 0, visited_ = 0;
  bool lists_free_pages_ = false;  ///< the tree that is checked
};

}  // namespace

void check_lmdb_file(const std::filesystem::path& data_file) { PageChecker(data_file).check(); }

}  // namespace doppel
