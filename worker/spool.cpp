#include "worker/spool.h"

#include <fstream>
#include <optional>

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
    if (!known || !fs::exists(tile) || !read_offer(offer)) leftovers.push_back(path);
  }
  for (const fs::path& path : leftovers) fs::remove(path);
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
  fs::remove(offer_path(result_key), ignored);
  fs::remove(tile_path(result_key), ignored);
}

std::vector<v1::ResultOffer> Spool::offers() const {
  std::vector<v1::ResultOffer> offers;
  for (const auto& entry : fs::directory_iterator(folder_))
    if (entry.path().extension() == ".offer")
      if (auto offer = read_offer(entry.path())) offers.push_back(std::move(*offer));
  return offers;
}

}  // namespace woodcock
