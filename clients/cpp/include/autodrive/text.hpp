/// \file
/// The texts of the devkits' messages: numbers, base64, and base64 of gzip.
#pragma once

#include <array>
#include <boost/beast/zlib/inflate_stream.hpp>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace autodrive::text {

/// Numbers that are separated by blanks or line ends; "inf" and "nan" in any case. What is no number is an error.
inline std::vector<double> numbers(std::string_view text) {
    std::vector<double> found;
    const char* at = text.data();
    const char* const end = at + text.size();
    const auto is_gap = [](char c) { return c == ' ' || c == '\n' || c == '\t' || c == '\r'; };
    while (true) {
        while (at != end && is_gap(*at)) ++at;
        if (at == end) return found;
        double value = 0.0;
        const auto [next, fault] = std::from_chars(at, end, value);
        if (fault != std::errc{}) {
            const char* word_end = at;
            while (word_end != end && !is_gap(*word_end)) ++word_end;
            throw std::invalid_argument("'" + std::string(at, word_end) + "' is not a number");
        }
        found.push_back(value);
        at = next;
    }
}

/// The bytes that a base64 text stands for. A text that is none is an error.
inline std::vector<std::uint8_t> base64(std::string_view text) {
    static constexpr auto values = [] {
        std::array<std::int8_t, 256> table{};
        for (auto& value : table) value = -1;
        constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        for (std::size_t i = 0; i < letters.size(); ++i)
            table[static_cast<unsigned char>(letters[i])] = static_cast<std::int8_t>(i);
        return table;
    }();
    while (!text.empty() && text.back() == '=') text.remove_suffix(1);
    std::vector<std::uint8_t> bytes;
    bytes.reserve(text.size() * 3 / 4);
    std::uint32_t gathered = 0;
    int bits = 0;
    for (const char letter : text) {
        const int value = values[static_cast<unsigned char>(letter)];
        if (value < 0) throw std::invalid_argument("base64 has no letter '" + std::string(1, letter) + "'");
        gathered = gathered << 6 | static_cast<std::uint32_t>(value);
        if ((bits += 6) >= 8) bytes.push_back(static_cast<std::uint8_t>(gathered >> (bits -= 8)));
    }
    return bytes;
}

/// What was compressed with gzip (RFC 1952; one member without optional fields but a name, as Python and .NET write it).
inline std::string gunzip(const std::vector<std::uint8_t>& data) {
    constexpr std::size_t header = 10, trailer = 8;
    constexpr std::uint8_t has_name = 8;
    if (data.size() < header + trailer || data[0] != 0x1f || data[1] != 0x8b || data[2] != 8 || (data[3] & ~has_name))
        throw std::invalid_argument("this is not gzip");
    std::size_t begin = header;
    if (data[3] & has_name) {
        while (begin < data.size() && data[begin]) ++begin;
        ++begin;
    }
    boost::beast::zlib::inflate_stream inflate;
    boost::beast::zlib::z_params params;
    params.next_in = data.data() + begin;
    params.avail_in = data.size() - trailer - begin;
    std::string content;
    std::array<char, 1 << 14> piece;
    boost::beast::error_code fault;
    while (!fault) {
        params.next_out = piece.data();
        params.avail_out = piece.size();
        inflate.write(params, boost::beast::zlib::Flush::sync, fault);
        content.append(piece.data(), piece.size() - params.avail_out);
        if (params.avail_out) break;
    }
    if (fault && fault != boost::beast::zlib::error::end_of_stream)
        throw std::invalid_argument("damaged gzip: " + fault.message());
    return content;
}

/// A LIDAR's values: plain text, or base64 of gzip of text, as since 2025.
inline std::vector<double> scan(std::string_view text) {
    return text.substr(0, 3) == "H4s" ? numbers(gunzip(base64(text))) : numbers(text);
}

}  // namespace autodrive::text
