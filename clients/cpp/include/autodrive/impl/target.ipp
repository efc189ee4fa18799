#pragma once

#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

#ifndef _WIN32
#include <pwd.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>
#endif

#include "autodrive/client.hpp"

namespace autodrive::detail {

/// 'host:port', with the brackets of an IPv6 address.
AUTODRIVE_INLINE std::string address_text(const std::string& host, unsigned short port) {
    return (host.find(':') == std::string::npos ? host : '[' + host + ']') + ':' + std::to_string(port);
}

/// Where a client without an address connects, and the run that must be there, as docs/client.md describes it.
struct Target {
    std::string host = "127.0.0.1";
    unsigned short port = 8730;
    std::string run;         ///< Id of that run; empty: any run, of any user if `is_chosen`.
    bool is_chosen = false;  ///< Whether the user has chosen the port.
};

/// Login name of the user; empty on Windows, where runs of other users are not recognised.
AUTODRIVE_INLINE std::string user_name() {
#ifdef _WIN32
    return "";
#else
    const passwd* entry = getpwuid(getuid());
    return entry ? entry->pw_name : std::to_string(getuid());
#endif
}

/// The port in the environment variable AUTODRIVE_PORT; 0: it is not set. Throws `Refused`.
AUTODRIVE_INLINE unsigned short port_of_environment() {
    const char* value = std::getenv("AUTODRIVE_PORT");
    const std::string text = value ? value : "";
    if (text.empty()) return 0;
    const bool is_number = text.size() < 6 && text.find_first_not_of("0123456789") == std::string::npos;
    const int port = is_number ? std::atoi(text.c_str()) : 0;
    if (port < 1 || port > 65535) throw Refused("AUTODRIVE_PORT must be a port, 1 to 65535, not '" + text + "'");
    return static_cast<unsigned short>(port);
}

/// The note of the last run of this user in the current folder that has not ended; null: there is none.
AUTODRIVE_INLINE Json last_run() {
    Json last;
#ifndef _WIN32
    namespace fs = std::filesystem;
    std::error_code ignored;
    const auto variable = [](const char* name) { return std::string(std::getenv(name) ? std::getenv(name) : ""); };
    fs::path cache = variable("XDG_CACHE_HOME");
#ifdef __APPLE__
    cache = fs::path(variable("HOME")) / "Library" / "Caches";
#else
    if (cache.empty()) cache = fs::path(variable("HOME")) / ".cache";
#endif
    const fs::path temporary = fs::temp_directory_path(ignored);
    const std::string here = fs::canonical(fs::current_path(ignored), ignored).string();
    char machine[256] = "";
    gethostname(machine, sizeof machine - 1);
    for (const fs::path& folder : {cache / "autodrive" / "runs", temporary / ("autodrive-" + user_name())}) {
        struct stat status = {};
        const bool is_own = lstat(folder.c_str(), &status) == 0 && S_ISDIR(status.st_mode) &&
                            status.st_uid == getuid() && (status.st_mode & 022) == 0;
        if (!is_own) continue;
        for (const auto& file : fs::directory_iterator(folder, ignored)) {
            if (file.path().extension() != ".json" || !file.is_regular_file(ignored)) continue;
            std::ifstream stream(file.path());
            const Json note = Json::parse(stream, nullptr, false);
            try {
                const bool is_here = note.at("folder") == here && note.at("machine") == machine;
                const auto process = note.at("process").get<pid_t>();
                const double started = note.at("origin").at("started").get<double>();
                if (is_here && kill(process, 0) == 0 &&
                    (last.is_null() || started > last.at("origin").at("started").get<double>()))
                    last = note;
            } catch (const Json::exception&) {  // it is no note
            }
        }
    }
#endif
    return last;
}

/// Throws `Refused` if that run does not listen yet, or has another port than AUTODRIVE_PORT.
AUTODRIVE_INLINE Target default_target() {
    Target target;
    const unsigned short port = port_of_environment();
    if (port != 0) {
        target.port = port;
        target.is_chosen = true;
    }
    const Json run = last_run();
    if (run.is_null()) return target;
    const std::string address = run.at("address").get<std::string>();
    const auto colon = address.rfind(':');
    if (colon == std::string::npos) throw Refused("the simulator in this folder does not listen yet");
    target.host = address.substr(0, colon);
    if (target.host.front() == '[') target.host = target.host.substr(1, target.host.size() - 2);
    target.port = static_cast<unsigned short>(std::atoi(address.c_str() + colon + 1));
    target.run = run.at("origin").at("id").get<std::string>();
    if (port != 0 && port != target.port)
        throw Refused("AUTODRIVE_PORT is " + std::to_string(port) + ", but the last run in this folder is at " + address +
                      ": give the address of the simulator that you want");
    return target;
}

/// 'alice at 2026-01-31 10:20:30', from the origin of a run.
AUTODRIVE_INLINE std::string described(const Json& origin) {
    if (origin.is_null()) return "an unknown user";
    const auto started = static_cast<std::time_t>(origin.at("started").get<double>());
    char text[32] = "";
    std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S", std::localtime(&started));
    return origin.at("user").get<std::string>() + " at " + text;
}

/// Throws `Refused` if a client must not use the simulator of that Welcome.
AUTODRIVE_INLINE void check_welcome(const Json& welcome, const Target& target) {
    const Json origin = welcome.value("run", Json());
    std::string problem;
    if (!target.run.empty() && (origin.is_null() || origin.at("id") != target.run))
        problem = "not the last run in this folder";
    else if (target.run.empty() && !target.is_chosen && !origin.is_null() && !user_name().empty() &&
             origin.at("user") != user_name())
        problem = "not a simulator of the user '" + user_name() + "', who has no run in this folder";
    if (!problem.empty())
        throw Refused("the simulator at " + address_text(target.host, target.port) + ", started by " + described(origin) +
                      ", is " + problem + ": give the address of the simulator that you want");
}

}  // namespace autodrive::detail
