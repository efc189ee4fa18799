// Steps a paused simulation. Prints the wall time of each step [ms], then the mean CPU time of a step [ms].
#include <autodrive/client.hpp>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <iostream>

int main(int argc, char** argv) {
    if (argc != 4) {
        std::cerr << "usage: step PORT STEPS PICTURE_RATE" << std::endl;
        return 2;
    }
    autodrive::Subscription subscription;
    subscription.picture_rate = std::atof(argv[3]);
    autodrive::Client simulator("127.0.0.1", static_cast<unsigned short>(std::atoi(argv[1])), "", subscription);
    const int steps = std::atoi(argv[2]);
    const std::clock_t before = std::clock();
    for (int i = 0; i < steps; ++i) {
        const auto start = std::chrono::steady_clock::now();
        simulator.step(1, {{"V1", {0.3, 0.1, {}, {}}}});
        std::cout << std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count() << '\n';
    }
    std::cout << 1e3 * static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC / steps << std::endl;
}
