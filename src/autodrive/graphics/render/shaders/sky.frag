// The sky: bright at the horizon, darker towards the zenith.
in vec3 ray;
flat in vec3 low, high;
#ifdef AIR
flat in float haze;  // extinction times the height of the layer of fog
#endif
out vec4 pixel;
void main() {
    float up = clamp(ray.z * inversesqrt(dot(ray, ray)), 0.0, 1.0);
    vec3 seen = mix(low, high, sqrt(up));
#ifdef AIR
    seen = mix(low, seen, exp(-haze / (up + 0.02)));
#endif
    pixel = vec4(seen, 1.0);
}
