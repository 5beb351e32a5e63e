// How readers that know little of EXR files find colour: tinyexr, which is not ours, and the rules of thumb of others.
#pragma once

#include <gtest/gtest.h>
#include <tinyexr.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace woodcock::testing {

/// What tinyexr's simplest call makes of a file: RGBA, row by row.
struct SmallPicture {
  int width = 0, height = 0;
  std::vector<float> rgba;
};

inline SmallPicture load_exr(const std::filesystem::path& path) {
  SmallPicture picture;
  float* pixels = nullptr;
  const char* error = nullptr;
  if (LoadEXR(&pixels, &picture.width, &picture.height, path.c_str(), &error) != TINYEXR_SUCCESS) {
    ADD_FAILURE() << path << ": " << (error ? error : "no reason");
    FreeEXRErrorMessage(error);
    return {};
  }
  picture.rgba.assign(pixels, pixels + 4 * static_cast<size_t>(picture.width) * static_cast<size_t>(picture.height));
  std::free(pixels);
  return picture;
}

/// The first header of a file, as tinyexr reads it.
struct SmallHeader {
  bool several_parts = false, tiled = false, deep = false, long_names = false;
  bool plain() const { return !several_parts && !tiled && !deep && !long_names; }
  EXRBox2i data{}, display{};
  std::vector<std::string> channels;  ///< in the file's order
};

inline SmallHeader read_header(const std::filesystem::path& path) {
  SmallHeader header;
  EXRVersion version;
  EXRHeader read;
  InitEXRHeader(&read);
  const char* error = nullptr;
  if (ParseEXRVersionFromFile(&version, path.c_str()) != TINYEXR_SUCCESS ||
      ParseEXRHeaderFromFile(&read, &version, path.c_str(), &error) != TINYEXR_SUCCESS) {
    ADD_FAILURE() << path << ": " << (error ? error : "is no EXR file");
    FreeEXRErrorMessage(error);
    return header;
  }
  header = {version.multipart != 0,
            version.tiled != 0,
            version.non_image != 0,
            version.long_name != 0,
            read.data_window,
            read.display_window,
            {}};
  for (int c = 0; c < read.num_channels; ++c) header.channels.emplace_back(read.channels[c].name);
  FreeEXRHeader(&read);
  return header;
}

}  // namespace woodcock::testing
