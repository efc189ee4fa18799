#pragma once

#include <boost/beast/zlib/inflate_stream.hpp>

#include "autodrive/text.hpp"

namespace autodrive::text {

AUTODRIVE_INLINE std::string gunzip(const std::vector<std::uint8_t>& data) {
    constexpr std::size_t header = 10, trailer = 8, limit = std::size_t{1} << 24;
    constexpr std::uint8_t has_name = 8;
    if (data.size() < header + trailer || data[0] != 0x1f || data[1] != 0x8b || data[2] != 8 || (data[3] & ~has_name))
        throw std::invalid_argument("not gzip data");
    std::size_t begin = header;
    const std::size_t end = data.size() - trailer;
    if (data[3] & has_name) {
        while (begin < end && data[begin]) ++begin;
        if (begin++ == end) throw std::invalid_argument("damaged gzip data: the name has no end");
    }
    boost::beast::zlib::inflate_stream inflate;
    boost::beast::zlib::z_params params;
    params.next_in = data.data() + begin;
    params.avail_in = begin < end ? end - begin : 0;
    std::string content;
    std::array<char, 1 << 14> chunk;
    boost::beast::error_code error;
    while (!error) {
        params.next_out = chunk.data();
        params.avail_out = chunk.size();
        inflate.write(params, boost::beast::zlib::Flush::sync, error);
        content.append(chunk.data(), chunk.size() - params.avail_out);
        if (content.size() > limit) throw std::invalid_argument("gzip data of more than 16 MB");
        if (params.avail_out) break;
    }
    if (error != boost::beast::zlib::error::end_of_stream) throw std::invalid_argument("damaged gzip data");
    return content;
}

}  // namespace autodrive::text
