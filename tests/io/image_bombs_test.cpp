// S38: pictures that lie about their size or end too early.
#include <OpenImageIO/imageio.h>

#include "rasterizer/io/image.h"
#include "rasterizer/io/image_decode.h"
#include "rasterizer/io/texture.h"
#include "scratch.h"

namespace halfshade {
namespace {

using test::Scratch;

std::string big_endian(std::uint32_t value) {
  return {static_cast<char>(value >> 24), static_cast<char>(value >> 16), static_cast<char>(value >> 8),
          static_cast<char>(value)};
}

std::string little_endian(std::uint32_t value) {
  const std::string bytes = big_endian(value);
  return {bytes.rbegin(), bytes.rend()};
}

std::uint32_t crc32(const std::string& bytes) {
  std::uint32_t crc = ~0u;
  for (const char c : bytes) {
    crc ^= static_cast<unsigned char>(c);
    for (int k = 0; k < 8; ++k) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0u);
  }
  return ~crc;
}

std::string chunk(const std::string& type, const std::string& data) {
  return big_endian(static_cast<std::uint32_t>(data.size())) + type + data + big_endian(crc32(type + data));
}

// 8-bit RGB of any claimed size with 8 bytes of data: 65 bytes.
std::string png_bomb(std::uint32_t width, std::uint32_t height) {
  const std::string header = big_endian(width) + big_endian(height) + std::string("\x08\x02\x00\x00\x00", 5);
  const std::string data("\x78\x9c\x63\x60\x60\x60\x00\x00", 8);
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR", header) + chunk("IDAT", data) + chunk("IEND", "");
}

std::string exr_attribute(const std::string& name, const std::string& type, const std::string& value) {
  return name + '\0' + type + '\0' + little_endian(static_cast<std::uint32_t>(value.size())) + value;
}

// Scanline EXR with one half channel and an empty body, not compressed unless told; `more` are further attributes.
std::string exr_bomb(std::uint32_t width, std::uint32_t height, const std::string& more = "", char compression = 0) {
  const std::string window = little_endian(0) + little_endian(0) + little_endian(width - 1) + little_endian(height - 1);
  const std::string channel =
      std::string("R\0", 2) + little_endian(1) + std::string(4, '\0') + little_endian(1) + little_endian(1) + '\0';
  return little_endian(20000630) + little_endian(2) + exr_attribute("channels", "chlist", channel) +
         exr_attribute("compression", "compression", std::string(1, compression)) +
         exr_attribute("dataWindow", "box2i", window) + exr_attribute("displayWindow", "box2i", window) +
         exr_attribute("lineOrder", "lineOrder", std::string(1, '\0')) +
         exr_attribute("pixelAspectRatio", "float", little_endian(0x3f800000)) +
         exr_attribute("screenWindowCenter", "v2f", std::string(8, '\0')) +
         exr_attribute("screenWindowWidth", "float", little_endian(0x3f800000)) + more + '\0';
}

test::Outcome decode(const std::filesystem::path& file) {
  return test::outcome_of([&] { decode_image(file, {}); });
}

void check_bomb(const std::string& bytes) {
  const Scratch scratch;
  const test::PeakMemory memory;
  const auto outcome = decode(scratch.write("bomb", bytes));
  CAPTURE(outcome.message);
  CHECK(outcome.threw);
  CHECK((outcome.code == ErrorCode::kBadInput || outcome.code == ErrorCode::kLimit));
  CHECK(outcome.has("bomb: "));
  CHECK(outcome.seconds < test::kHang);
  CHECK(memory.growth() < 64.0);
}

TEST_CASE("S38 image_bombs: headers that promise gigabytes are refused at once and in little memory") {
  CHECK(png_bomb(1, 1).size() == 65);
  for (const std::uint32_t side : {18000u, 30000u, 32768u, 40000u, 0x7fffffffu}) check_bomb(png_bomb(side, side));
  check_bomb(png_bomb(0, 5));
  check_bomb(png_bomb(200, 200));
  check_bomb(std::string("\x00\x00\x02\x00\x00\x00\x00\x00\x00\x00\x00\x00\xff\xff\xff\xff\x20\x00", 18));  // TGA
  for (const std::uint32_t side : {16000u, 30000u, 32768u, 40000u, 0x7fffffffu, 0x80000000u, 0u})
    check_bomb(exr_bomb(side, side));
}

TEST_CASE(
    "S38 image_bombs: EXR attributes that claim to be longer than the file are refused before memory is set aside") {
  const std::string gigabyte = little_endian(1u << 30);
  const std::string name_and = std::string("extra\0", 6);
  for (const char* type : {"opaque", "string", "floatvector"}) {
    const std::string claim = name_and + type + '\0' + gigabyte + "x";
    CAPTURE(type);
    const Scratch scratch;
    CHECK(decode(scratch.write("bomb", exr_bomb(4, 4, claim))).has("EXR is truncated or damaged"));
    check_bomb(exr_bomb(4, 4, claim));
  }
  check_bomb(exr_bomb(4, 4, exr_attribute("extra", "stringvector", gigabyte + "x")));
  check_bomb(exr_bomb(4, 4, exr_attribute("extra", "preview", little_endian(16000) + little_endian(16000))));
  // OpenEXR reads four bytes here whatever the length says, and takes what follows for the next attribute.
  check_bomb(
      exr_bomb(4, 4, exr_attribute("extra", "int", std::string(4, '\0') + name_and + "opaque" + '\0' + gigabyte)));
}

TEST_CASE("S38 image_bombs: EXR rows that are compressed together, and tiles, are refused before memory is set aside") {
  constexpr char kZip = 3, kDwab = 9, kUnknown = 11;
  const Scratch scratch;
  for (const char compression : {kZip, kDwab, kUnknown}) {
    const std::string bomb = exr_bomb(0x7ffffff0, 1, "", compression);
    CHECK(decode(scratch.write("bomb", bomb)).has("allowed at most 1073741824"));
    check_bomb(bomb);
  }
  const auto tile = [](std::uint32_t side) {
    return exr_attribute("tiles", "tiledesc", little_endian(side) + little_endian(side) + '\0');
  };
  for (const std::uint32_t side : {40000u, 0x7fffffffu, 0xffffffffu}) {
    CHECK(decode(scratch.write("bomb", exr_bomb(4, 4, tile(side)))).has("allowed at most 1073741824"));
    check_bomb(exr_bomb(4, 4, tile(side)));
  }
  // Rows of pictures that are allowed pass this check; this one fails behind it, as it has no pixels.
  CHECK_FALSE(decode(scratch.write("picture", exr_bomb(32768, 1, tile(64), kDwab))).has("allowed at most"));
}

TEST_CASE("S38 image_bombs: a bomb as texture stops the loading") {
  const Scratch scratch;
  TextureSet textures;
  textures.request(scratch.write("bomb.png", png_bomb(30000, 30000)), TextureKind::kColor);
  Scene scene;
  CHECK(test::outcome_of([&] { textures.load(scene, std::uint64_t{1} << 30); }).threw);
  CHECK(scene.color_maps.empty());
}

TEST_CASE("S38 image_bombs: only PNG, JPEG and EXR are read, whatever the name says") {
  const Scratch scratch;
  for (const char* bytes : {"", "\x89PN", "GIF89a", "II*", "MM", "BM", "P6 1 1 255 abc", "#?RADIANCE\n", "SDPX", "8BPS",
                            "not a picture at all"}) {
    const auto outcome = decode(scratch.write("picture.png", bytes));
    CHECK(outcome.code == ErrorCode::kBadInput);
    CHECK(outcome.has("PNG, JPEG or EXR"));
  }
}

// Written by OpenImageIO itself, since the project writes no JPEG.
void write_with(const std::string& name, int channels, OIIO::TypeDesc type) {
  const auto output = OIIO::ImageOutput::create(name);
  REQUIRE(output);
  OIIO::ImageSpec spec(40, 30, channels, type);
  REQUIRE(output->open(name, spec));
  std::vector<float> pixels(static_cast<std::size_t>(40 * 30 * channels));
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<float>((i * 7919) % 251) / 251.0f;
  REQUIRE(output->write_image(OIIO::TypeFloat, pixels.data()));
  REQUIRE(output->close());
}

TEST_CASE("S38 image_bombs: a JPEG whose few bytes claim a gigabyte is refused before libjpeg fills it with grey") {
  const Scratch scratch;
  write_with(scratch.path("a.jpg").string(), 3, OIIO::TypeUInt8);
  std::string bytes = test::read_bytes(scratch.path("a.jpg"));
  const std::size_t frame = bytes.find("\xff\xc0");
  REQUIRE(frame != std::string::npos);
  for (const std::uint32_t side : {4000u, 18000u, 30000u}) {
    bytes.replace(frame + 5, 4, big_endian(side << 16 | side));
    check_bomb(bytes);
  }
}

TEST_CASE("S38 image_bombs: pictures cut off at each sixteenth are refused, whole ones are read") {
  for (const std::string name : {"a.png", "a.jpg", "a.exr"}) {
    CAPTURE(name);
    const Scratch scratch;
    write_with(scratch.path(name).string(), 3, name == "a.exr" ? OIIO::TypeHalf : OIIO::TypeUInt8);
    const std::string whole = test::read_bytes(scratch.path(name));
    CHECK_FALSE(decode(scratch.path(name)).threw);
    for (std::size_t k = 0; k < 16; ++k) {
      CAPTURE(k);
      const auto outcome = decode(scratch.write("cut", whole.substr(0, whole.size() * k / 16)));
      CHECK(outcome.threw);
      CHECK(outcome.code == ErrorCode::kBadInput);
    }
    CHECK(decode(scratch.write("cut", whole.substr(0, whole.size() - 1))).threw);
  }
}

TEST_CASE("S38 image_bombs: flipped bits give an error or a picture, never a crash") {
  for (const std::string name : {"a.png", "a.jpg", "a.exr"}) {
    const Scratch scratch;
    write_with(scratch.path(name).string(), 4 - (name == "a.jpg"), name == "a.exr" ? OIIO::TypeHalf : OIIO::TypeUInt8);
    const std::string whole = test::read_bytes(scratch.path(name));
    for (std::size_t k = 0; k < 300; ++k) {
      std::string damaged = whole;
      damaged[(k * 2654435761u) % damaged.size()] ^= static_cast<char>(1 << k % 8);
      const auto outcome = decode(scratch.write("flipped", damaged));
      if (outcome.threw) REQUIRE((outcome.code == ErrorCode::kBadInput || outcome.code == ErrorCode::kLimit));
    }
  }
}

TEST_CASE("colours are not multiplied by alpha, and map_d takes the alpha channel if there is one") {
  const Scratch scratch;
  const std::string file = scratch.path("a.png").string();
  const std::uint8_t pixels[] = {200, 100, 50, 128, 10, 20, 30, 0};
  const auto output = OIIO::ImageOutput::create(file);
  OIIO::ImageSpec spec(2, 1, 4, OIIO::TypeUInt8);
  spec.attribute("oiio:UnassociatedAlpha", 1);
  REQUIRE(output->open(file, spec));
  REQUIRE(output->write_image(OIIO::TypeUInt8, pixels));
  REQUIRE(output->close());
  TextureSet textures;
  const auto request = textures.request(file, TextureKind::kColor);
  CHECK(textures.request(file, TextureKind::kAlpha) == request);
  Scene scene;
  textures.load(scene, 1 << 20);
  CHECK(scene.color_maps[textures.color_map(request)].rgb == std::vector<std::uint8_t>{200, 100, 50, 10, 20, 30});
  CHECK(scene.alpha_maps[textures.alpha_map(request)].alpha == std::vector<std::uint8_t>{128, 0});
}

TEST_CASE("linear EXR textures get the sRGB curve, single channels count for all colours") {
  const Scratch scratch;
  const std::vector<float> grey = {0.0f, 0.5f, 2.0f, 0.18f};
  const ImageChannel channel{"Y", ImageChannel::Type::kFloat, grey.data()};
  write_exr(scratch.path("a.exr"), 2, 2, {&channel, 1}, {});
  TextureSet textures;
  const auto request = textures.request(scratch.path("a.exr"), TextureKind::kColor);
  Scene scene;
  textures.load(scene, 1 << 20);
  CHECK(scene.color_maps[textures.color_map(request)].rgb ==
        std::vector<std::uint8_t>{0, 0, 0, 188, 188, 188, 255, 255, 255, 118, 118, 118});
}

}  // namespace
}  // namespace halfshade
