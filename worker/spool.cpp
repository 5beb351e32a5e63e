#include "worker/spool.h"

#include <array>
#include <fstream>
#include <optional>

#include "renderer/core/sha256.h"
#include "renderer/film/atomic_file.h"
#include "rpc/convert.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;

std::optional<v1::ResultOffer> read_offer(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  v1::ResultOffer offer;
  const bool whole = offer.ParseFromIstream(&file) && rpc::is_digest(offer.result_key()) && path.stem() == offer.result_key();
  return whole ? std::optional(offer) : std::nullopt;
}

}  // namespace

Spool::Spool(fs::path folder) : folder_(std::move(folder)) {
  fs::create_directories(folder_);
  std::vector<fs::path> leftovers;
  for (const auto& entry : fs::directory_iterator(folder_)) {
    const fs::path& path = entry.path();
    const fs::path tile = fs::path(path).replace_extension(".exr"), offer = fs::path(path).replace_extension(".offer");
    const bool known = path == tile || path == offer;
    std::error_code unreadable;
    if (!known || !fs::is_regular_file(tile, unreadable) || !read_offer(offer)) leftovers.push_back(path);
  }
  std::error_code ignored;
  for (const fs::path& path : leftovers) fs::remove_all(path, ignored);
}

void Spool::make_room(const std::string& result_key) const {
  std::error_code error;
  fs::create_directories(folder_, error);
  const fs::path path = tile_path(result_key);
  if (const auto type = fs::symlink_status(path, error).type(); type != fs::file_type::regular && type != fs::file_type::not_found)
    fs::remove_all(path, error);
}

bool Spool::holds(const std::string& result_key, const std::string& digest) const {
  std::ifstream file(tile_path(result_key), std::ios::binary);
  Sha256 hash;
  std::array<char, 1 << 16> buffer;
  while (file) {
    file.read(buffer.data(), buffer.size());
    hash.raw(buffer.data(), static_cast<size_t>(file.gcount()));
  }
  return file.eof() && hash.hex() == digest;
}

fs::path Spool::offer_path(const std::string& result_key) const { return folder_ / (result_key + ".offer"); }
std::string Spool::tile_path(const std::string& result_key) const { return folder_ / (result_key + ".exr"); }

void Spool::add(const v1::ResultOffer& offer) {
  AtomicFile file(offer_path(offer.result_key()));
  {
    std::ofstream out(file.path(), std::ios::binary);
    offer.SerializeToOstream(&out);
  }
  file.commit();
}

void Spool::remove(const std::string& result_key) {
  std::error_code ignored;  // a file that stays is offered again after a restart, and refused
  fs::remove_all(offer_path(result_key), ignored);
  fs::remove_all(tile_path(result_key), ignored);
}

std::vector<v1::ResultOffer> Spool::offers() const {
  std::vector<v1::ResultOffer> offers;
  std::error_code error;
  for (fs::directory_iterator it(folder_, error), end; !error && it != end; it.increment(error))
    if (it->path().extension() == ".offer")
      if (auto offer = read_offer(it->path())) offers.push_back(std::move(*offer));
  return offers;
}

}  // namespace woodcock
