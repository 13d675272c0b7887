#include "doppel/data/dataset/loader.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/data/dataset/sampling.h"

namespace doppel {

namespace {

void check_options(const LoaderOptions& options) {
  const auto require = [](bool good, const char* name, long value, const char* allowed) {
    if (!good) fail<UsageError>("the loader's {} is {}; it must be {}", name, value, allowed);
  };
  require(options.batch_size >= 1, "batch size", options.batch_size, "at least 1");
  require(options.cameras_per_sample >= 0, "cameras per sample", options.cameras_per_sample, "at least 0 (0: all)");
  require(options.past_frames >= 0 && options.past_frames <= 1000, "number of past frames", options.past_frames,
          "0 to 1000");
  require(options.workers >= 0 && options.workers <= 256, "number of workers", options.workers, "0 to 256");
  require(options.prefetch >= 1 && options.prefetch <= 1024, "prefetch depth", options.prefetch, "1 to 1024");
  require(options.cache_mb >= 0, "cache", options.cache_mb, "at least 0 MB");
  require(options.person_size == 0 || (options.person_size >= 16 && options.person_size <= 4096),
          "size of person images", options.person_size, "0 (none) or 16 to 4096");
}

SamplePlan make_plan(const Dataset& dataset, const LoaderOptions& options) {
  const std::vector<SampleId> samples = chosen_samples(dataset, options.split, options.frames);
  const std::vector<int> cameras = dataset.camera_indices(options.cameras);
  const int all = static_cast<int>(cameras.size());
  const int draw = options.cameras_per_sample == 0 ? all : std::min(options.cameras_per_sample, all);
  return SamplePlan(samples, cameras, draw, options.seed);
}

}  // namespace

BatchOptions batch_options(const LoaderOptions& o) {
  return {o.past_frames, o.images, o.image_size, o.keypoints, o.person_size, o.augment};
}

struct Loader::Impl {
  /// A batch from a worker, or the worker's error.
  struct Loaded {
    Batch batch;
    std::exception_ptr error;
  };

  const Dataset& dataset;
  LoaderOptions options;
  SamplePlan plan;
  CropCache cache;
  BatchShare share;
  std::int64_t next_batch = 0;  ///< the next to return; the stream's position is this * batch_size + first_sample
  std::int64_t first_sample = 0;

  std::mutex mutex;
  std::condition_variable wake_workers, wake_reader;
  std::map<std::int64_t, Loaded> ready;
  std::int64_t next_ticket = 0;  ///< the batch that the next free worker takes
  bool stopping = false;
  std::vector<std::thread> threads;

  Impl(const Dataset& data, LoaderOptions chosen)
      : dataset(data),
        options(std::move(chosen)),
        plan(make_plan(data, options)),
        cache(as_size(options.cache_mb) << 20),
        share{0, options.batch_size, options.batch_size} {
    start();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() { stop(); }

  void start() {
    stopping = false;
    for (int i = 0; i < options.workers; ++i) threads.emplace_back([this] { work(); });
  }

  void stop() {
    {
      std::lock_guard lock(mutex);
      stopping = true;
    }
    wake_workers.notify_all();
    for (std::thread& thread : threads) thread.join();
    threads.clear();
    ready.clear();
  }

  Loaded load(std::int64_t number) {
    Loaded loaded;
    try {
      // Workers record no autograd history. Gradient mode is per thread.
      torch::NoGradGuard no_grad;
      const auto items =
          plan.items(first_sample + number * options.batch_size + share.first, static_cast<int>(share.count));
      loaded.batch = build_batch(dataset, cache, items, batch_options(options));
    } catch (...) {
      loaded.error = std::current_exception();
    }
    return loaded;
  }

  void work() {
    std::unique_lock lock(mutex);
    while (true) {
      wake_workers.wait(lock, [this] { return stopping || next_ticket < next_batch + options.prefetch; });
      if (stopping) return;
      const std::int64_t number = next_ticket++;
      lock.unlock();
      Loaded loaded = load(number);
      lock.lock();
      ready.emplace(number, std::move(loaded));
      wake_reader.notify_all();
    }
  }

  Loaded take() {
    if (options.workers == 0) return load(next_batch);
    std::unique_lock lock(mutex);
    wake_reader.wait(lock, [this] { return ready.count(next_batch) > 0; });
    return std::move(ready.extract(next_batch).mapped());
  }

  Batch next() {
    Loaded loaded = take();
    {
      std::lock_guard lock(mutex);
      ++next_batch;
    }
    wake_workers.notify_all();
    if (loaded.error) std::rethrow_exception(loaded.error);
    return std::move(loaded.batch);
  }

  std::int64_t position() const { return first_sample + next_batch * options.batch_size; }

  void go_to(std::int64_t position, std::uint64_t seed) {
    stop();
    first_sample = position;
    next_batch = next_ticket = 0;
    plan.set_seed(seed);
    start();
  }
};

Loader::Loader(const Dataset& dataset, LoaderOptions options) {
  check_options(options);
  if (options.images) dataset.image_pixels(options.image_size);
  if (options.keypoints) dataset.require_landmarks();
  impl_ = std::make_unique<Impl>(dataset, std::move(options));
}

Loader::~Loader() = default;

Batch Loader::next() { return impl_->next(); }

void Loader::take_share(int rank, int world) {
  const int whole = impl_->options.batch_size;
  if (world > whole)
    fail<UsageError>(
        "a batch of {} cannot be shared by {} ranks, because every rank needs a sample; start at most {} ranks, or set "
        "a "
        "larger data.batch_size",
        whole, world, whole);
  impl_->stop();
  impl_->share = BatchShare::of(rank, world, whole);
  impl_->go_to(impl_->position(), impl_->plan.seed());
}

BatchShare Loader::share() const { return impl_->share; }

std::string Loader::state() const {
  return nlohmann::json{{"loader", 1},
                        {"seed", impl_->plan.seed()},
                        {"position", impl_->position()},
                        {"batch_size", impl_->options.batch_size},
                        {"window", impl_->options.past_frames},
                        {"samples", impl_->plan.fingerprint()}}
      .dump();
}

void Loader::restore(const std::string& state) {
  try {
    const nlohmann::json saved = nlohmann::json::parse(state);
    if (saved.at("loader").get<int>() != 1) fail("the loader's state was written by another version");
    const auto seed = saved.at("seed").get<std::uint64_t>();
    const auto position = saved.at("position").get<std::int64_t>();
    if (saved.at("samples").get<std::string>() != impl_->plan.fingerprint())
      fail(
          "the loader's state belongs to other frames or cameras than the current ones; resume with the same "
          "capture "
          "and the same cameras");
    if (saved.at("batch_size").get<int>() != impl_->options.batch_size ||
        saved.at("window").get<int>() != impl_->options.past_frames)
      fail("the loader's state belongs to batches of {} with {} past frames, now it is {} and {}; resume with the same",
           saved.at("batch_size").get<int>(), saved.at("window").get<int>(), impl_->options.batch_size,
           impl_->options.past_frames);
    if (position < 0) fail("the loader's state has the position {}; it is damaged", position);
    impl_->go_to(position, seed);
  } catch (const nlohmann::json::exception& e) {
    fail("the loader's state cannot be read: {}", e.what());
  }
}

}  // namespace doppel
