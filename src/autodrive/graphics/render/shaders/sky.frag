// The sky: bright at the horizon, darker towards the zenith.
in vec3 ray;
flat in vec3 low, high;
out vec4 pixel;
void main() {
    float up = clamp(ray.z * inversesqrt(dot(ray, ray)), 0.0, 1.0);
    pixel = vec4(mix(low, high, sqrt(up)), 1.0);
}
