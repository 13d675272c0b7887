#include "doppel/data/prepare/store.h"

#include <lmdb.h>

#include <algorithm>
#include <mutex>
#include <shared_mutex>

#include "doppel/core/error.h"
#include "doppel/core/lmdb_file.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kInitialMap = std::size_t{64} << 20;  // doubled when it is full
constexpr std::size_t kMaxKey = 511;                        // LMDB's limit

fs::path data_file(const fs::path& folder) { return folder / "data.mdb"; }

MDB_val value_of(const std::string& text) { return {text.size(), const_cast<char*>(text.data())}; }

void check(int code, const fs::path& folder, const char* doing) {
  if (code != MDB_SUCCESS) fail_at({data_file(folder).string(), 0}, "{} failed: {}", doing, mdb_strerror(code));
}

/// Aborts a transaction that was not committed.
class Transaction {
 public:
  Transaction(MDB_env* environment, bool write, const fs::path& folder) {
    check(mdb_txn_begin(environment, nullptr, write ? 0 : MDB_RDONLY, &handle_), folder, "beginning a transaction");
  }
  ~Transaction() {
    if (handle_) mdb_txn_abort(handle_);
  }
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  MDB_txn* get() const { return handle_; }
  int commit() { return mdb_txn_commit(std::exchange(handle_, nullptr)); }

 private:
  MDB_txn* handle_ = nullptr;
};

}  // namespace

struct Store::Impl {
  fs::path folder;
  MDB_env* environment = nullptr;
  MDB_dbi database = 0;
  std::size_t map_bytes = kInitialMap;
  // Enlarging the map moves it, so no transaction of this process may be open.
  mutable std::shared_mutex map_lock;

  Impl(fs::path where, Mode mode) : folder(std::move(where)) {
    if (fs::exists(data_file(folder)) && fs::file_size(data_file(folder)) > 0)
      check_lmdb_file(data_file(folder));
    else if (mode == Mode::read)
      fail_at({folder.string(), 0},
              "there is no store here (data.mdb is missing or empty); run `doppel prepare` first");
    if (mode == Mode::write) fs::create_directories(folder);
    check(mdb_env_create(&environment), folder, "setting LMDB up");
    try {
      open(mode);
    } catch (...) {
      mdb_env_close(environment);
      throw;
    }
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() { mdb_env_close(environment); }

  void open(Mode mode) {
    // Readers create no lock file, so that a prepared capture can be on a read-only disk.
    const unsigned flags = mode == Mode::read ? MDB_RDONLY | MDB_NOLOCK | MDB_NOTLS : MDB_NOTLS;
    if (mode == Mode::write) {
      if (fs::exists(data_file(folder)))
        map_bytes = std::max<std::size_t>(map_bytes, 2 * fs::file_size(data_file(folder)));
      check(mdb_env_set_mapsize(environment, map_bytes), folder, "sizing the store");
    }
    check(mdb_env_open(environment, folder.c_str(), flags, 0644), folder, "opening the store");
    Transaction transaction(environment, mode == Mode::write, folder);
    check(mdb_dbi_open(transaction.get(), nullptr, 0, &database), folder, "opening the store");
    check(transaction.commit(), folder, "opening the store");
  }

  int try_put(const std::vector<std::pair<std::string, std::string>>& items) {
    Transaction transaction(environment, true, folder);
    for (const auto& [key, value] : items) {
      MDB_val key_value = value_of(key), data = value_of(value);
      if (const int code = mdb_put(transaction.get(), database, &key_value, &data, 0)) return code;
    }
    return transaction.commit();
  }
};

Store::Store(const fs::path& folder, Mode mode) : impl_(std::make_unique<Impl>(folder, mode)) {}
Store::~Store() = default;
Store::Store(Store&&) noexcept = default;
Store& Store::operator=(Store&&) noexcept = default;

const fs::path& Store::folder() const { return impl_->folder; }

bool Store::exists(const fs::path& folder) { return fs::exists(data_file(folder)); }

std::optional<std::string> Store::get(const std::string& key) const { return get_head(key, std::string::npos); }

std::optional<std::string> Store::get_head(const std::string& key, std::size_t bytes) const {
  std::shared_lock lock(impl_->map_lock);
  Transaction transaction(impl_->environment, false, impl_->folder);
  MDB_val key_value = value_of(key), data{};
  const int code = mdb_get(transaction.get(), impl_->database, &key_value, &data);
  if (code == MDB_NOTFOUND) return std::nullopt;
  check(code, impl_->folder, "reading");
  return std::string(static_cast<const char*>(data.mv_data), std::min(bytes, data.mv_size));
}

std::vector<std::string> Store::keys(const std::string& prefix) const {
  std::shared_lock lock(impl_->map_lock);
  Transaction transaction(impl_->environment, false, impl_->folder);
  MDB_cursor* cursor = nullptr;
  check(mdb_cursor_open(transaction.get(), impl_->database, &cursor), impl_->folder, "listing");
  std::vector<std::string> result;
  MDB_val key = value_of(prefix), data{};
  int code = mdb_cursor_get(cursor, &key, &data, prefix.empty() ? MDB_FIRST : MDB_SET_RANGE);
  for (; code == MDB_SUCCESS; code = mdb_cursor_get(cursor, &key, &data, MDB_NEXT)) {
    std::string found(static_cast<const char*>(key.mv_data), key.mv_size);
    if (found.compare(0, prefix.size(), prefix) != 0) break;
    result.push_back(std::move(found));
  }
  mdb_cursor_close(cursor);
  if (code != MDB_SUCCESS && code != MDB_NOTFOUND) check(code, impl_->folder, "listing");
  return result;
}

void Store::put(const std::vector<std::pair<std::string, std::string>>& items) {
  for (const auto& item : items)
    if (item.first.empty() || item.first.size() > kMaxKey)
      fail("internal: '{}' is not a key for the store", item.first);
  std::unique_lock lock(impl_->map_lock);
  int code = impl_->try_put(items);
  while (code == MDB_MAP_FULL) {
    impl_->map_bytes *= 2;
    check(mdb_env_set_mapsize(impl_->environment, impl_->map_bytes), impl_->folder, "enlarging the store");
    code = impl_->try_put(items);
  }
  check(code, impl_->folder, "writing");
}

}  // namespace doppel
