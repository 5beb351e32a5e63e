#include <fmt/format.h>

#include <cstring>
#include <fstream>

#include "renderer/film/exr_layout.h"

namespace woodcock::exr {

void set_numbers(const std::filesystem::path& file, const std::vector<std::string>& names, const std::vector<float>& values) {
  const auto check = [&](bool good) {
    if (!good) throw FilmError(file.string(), "cannot be written: its header has no place for the numbers about the picture");
  };
  check(names.size() == values.size());
  std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
  const auto text = [&] {
    std::string value;
    std::getline(stream, value, '\0');
    return value;
  };
  // "OpenEXR File Layout": magic number and version, then attributes as name, type, size, bytes, up to an empty name.
  stream.seekg(8);
  size_t found = 0;
  for (std::string name = text(); stream && !name.empty(); name = text()) {
    const std::string type = text();
    int32_t size = 0;
    stream.read(reinterpret_cast<char*>(&size), sizeof size);
    const auto place = stream.tellg();
    for (size_t i = 0; i < names.size(); ++i) {
      if (name != "woodcock:" + names[i]) continue;
      check(type == "float" && size == sizeof(float));
      stream.seekp(place);
      stream.write(reinterpret_cast<const char*>(&values[i]), sizeof(float));
      ++found;
    }
    stream.seekg(place + std::streamoff{size});
  }
  stream.close();
  check(!stream.fail() && found == names.size());
}

}  // namespace woodcock::exr
