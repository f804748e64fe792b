// Names of objects as ids in EXR files, as Cryptomatte 1.2 has them [Friedman and Jones 2015], so that
// compositing programs make mattes of objects. A layer NAME of mattes has channels NAME00.R, .G, .B, .A,
// NAME01.R, ...: for each pixel pairs of an id and its coverage, the largest coverage first.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>

namespace candela::image {

// MurmurHash3_x86_32 with the seed 0 (A. Appleby).
std::uint32_t murmur3_32(std::string_view text);

// The bits of a name's id, which is a float: its hash, one bit flipped if that is no normal number.
std::uint32_t matte_id_bits(std::string_view name);

// Adds the attributes of a layer of mattes, cryptomatte/KEY/name and so on, with the manifest of its names.
void add_matte_attributes(std::string_view layer, std::span<const std::string> names,
                          std::map<std::string, std::string>& attributes);

// {"NAME":"8 hex digits of its id",...}. Bytes that are no UTF-8 show as U+FFFD; names of equal ids all
// appear.
std::string matte_manifest(std::span<const std::string> names);

}  // namespace candela::image
