// Finished results that the coordinator has not acknowledged yet.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "woodcock/v1/workers_service.pb.h"

namespace woodcock {

/// A folder with two files a result: KEY.exr and KEY.offer (the serialized ResultOffer), both durable, the offer last:
/// a result without one is thrown away at start. What is here survives a crash and is offered again (HARD_CASES F13).
class Spool {
 public:
  /// Reads what an earlier process left and removes its unfinished files, and those that cannot be read. Throws
  /// std::filesystem::filesystem_error when the folder itself cannot be used.
  explicit Spool(std::filesystem::path folder);

  /// Where the tile of this result is to be written, whole and durably, before add().
  std::string tile_path(const std::string& result_key) const;
  /// Makes the folder again, and the way to the tile's path free, before a tile is written there.
  void make_room(const std::string& result_key) const;
  /// Whether the tile can be read and has this digest. Call it before the tile is used: the disk may have lost it.
  bool holds(const std::string& result_key, const std::string& digest) const;
  /// Throws FilmError when the offer cannot be made durable.
  void add(const v1::ResultOffer& offer);
  void remove(const std::string& result_key);
  /// What the folder holds, read from disk.
  std::vector<v1::ResultOffer> offers() const;

 private:
  std::filesystem::path offer_path(const std::string& result_key) const;
  std::filesystem::path folder_;
};

}  // namespace woodcock
