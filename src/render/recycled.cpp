#include "doppel/render/recycled.h"

#include <cstdlib>
#include <deque>
#include <mutex>
#include <new>

#include "doppel/core/as_size.h"

namespace doppel::render {
namespace {

constexpr std::size_t kMinBytes = std::size_t{1} << 18, kMaxKeptBytes = std::size_t{1} << 28, kAlignment = 64;

/// Unused blocks, the longest unused first.
class Store {
 public:
  void* take(std::size_t size) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      for (auto block = blocks_.rbegin(); block != blocks_.rend(); ++block) {
        if (block->size != size) continue;
        void* memory = block->memory;
        blocks_.erase(std::next(block).base());
        kept_ -= size;
        return memory;
      }
    }
    void* memory = std::aligned_alloc(kAlignment, size);
    if (memory == nullptr) throw std::bad_alloc();
    return memory;
  }

  void give_back(void* memory, std::size_t size) {
    const std::lock_guard<std::mutex> lock(mutex_);
    blocks_.push_back({memory, size});
    kept_ += size;
    while (kept_ > kMaxKeptBytes) {
      std::free(blocks_.front().memory);
      kept_ -= blocks_.front().size;
      blocks_.pop_front();
    }
  }

 private:
  struct Block {
    void* memory;
    std::size_t size;
  };
  std::mutex mutex_;
  std::deque<Block> blocks_;
  std::size_t kept_ = 0;
};

/// Never destroyed: tensors may outlive static objects.
Store& store() {
  static Store* const instance = new Store;
  return *instance;
}

}  // namespace

torch::Tensor recycled_empty(torch::IntArrayRef sizes, torch::ScalarType dtype) {
  std::size_t bytes = torch::elementSize(dtype);
  for (const std::int64_t size : sizes) bytes *= as_size(size);
  if (bytes < kMinBytes) return torch::empty(sizes, dtype);
  const std::size_t block = (bytes + kAlignment - 1) / kAlignment * kAlignment;
  void* memory = store().take(block);
  return torch::from_blob(
      memory, sizes, [block](void* p) { store().give_back(p, block); }, torch::TensorOptions(dtype));
}

}  // namespace doppel::render
