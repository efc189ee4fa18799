// Sets weather and time of day, prints what the Frames say, and the answer to a wrong weather.
#include <autodrive/client.hpp>
#include <cstdlib>
#include <iostream>

namespace {

void print(const autodrive::Frame& frame) {
    if (!frame.weather) {
        std::cout << "clear" << std::endl;
        return;
    }
    const auto& weather = *frame.weather;
    std::cout << weather.clouds << ' ' << weather.fog << ' ' << weather.rain << ' ' << weather.snow << ' ' << weather.wind
              << ' ' << weather.wetness.value_or(-1.0) << ' ' << weather.snow_cover.value_or(-1.0) << ' '
              << frame.time_of_day.value_or(-1.0) << std::endl;
}

}  // namespace

int main(int, char** argv) {
    autodrive::Client simulator("127.0.0.1", static_cast<unsigned short>(std::atoi(argv[1])));
    simulator.pause();
    autodrive::Weather weather;
    weather.rain = 0.6;
    weather.wind = 0.25;
    weather.snow_cover = 0.5;
    simulator.set_time_of_day(66600.0);
    print(simulator.set_weather(weather));
    print(simulator.step(2000));
    try {
        weather.fog = 1.5;
        simulator.set_weather(weather);
    } catch (const autodrive::Refused& refused) {
        std::cout << refused.what() << std::endl;
    }
    weather = {};
    weather.wetness = weather.snow_cover = 0.0;
    print(simulator.set_weather(weather));
    simulator.resume();
}
