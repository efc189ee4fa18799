// The sky: bright at the horizon, deeper towards the zenith.
layout(std140) uniform Frame { FRAME_FIELDS };
layout(std140) uniform Sight { mat4 clip_from_map; vec4 eye; };
uniform mat4 map_from_clip;
in vec2 corner;
out vec4 pixel;
TONE
void main() {
    vec4 near = map_from_clip * vec4(corner, -1.0, 1.0), far = map_from_clip * vec4(corner, 1.0, 1.0);
    vec3 d = normalize(far.xyz / far.w - near.xyz / near.w);
    float h = sqrt(clamp(d.z, 0.0, 1.0));
    vec3 seen = mix(horizon.rgb, zenith.rgb, h);
    pixel = vec4(shown(seen * 0.31831 * exposure.x), 1.0);
}
