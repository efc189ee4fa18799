// Light of headlights that the air scatters towards the camera: a coarse grid over the image, two triangles for each six
// vertices. Along the view ray of each vertex, single scattering by air that scatters equally in all directions.
layout(std140) uniform Frame { FRAME_FIELDS };
uniform mat4 map_from_clip;
uniform int heads;
const ivec2 CELLS = ivec2(24, 18);
const int STEPS = 10;
out vec3 scattered;
vec3 place;
LIGHT_FORMULAS
void main() {
    int cell = gl_VertexID / 6, corner = gl_VertexID - 6 * cell;
    ivec2 at = ivec2(cell % CELLS.x, cell / CELLS.x);
    at += ivec2(corner == 1 || corner == 2 || corner == 4, corner == 2 || corner > 3);
    vec2 clip = 2.0 * vec2(at) / vec2(CELLS) - 1.0;
    vec4 from = map_from_clip * vec4(clip, -1.0, 1.0), to = map_from_clip * vec4(clip, 1.0, 1.0);
    vec3 eye_place = from.xyz / from.w, ray = normalize(to.xyz / to.w - eye_place), l;
    float reach = ray.z < 0.0 ? min(3.0, eye_place.z / -ray.z) : 3.0;  // to the ground, else far enough
    scattered = vec3(0.0);
    for (int step_ = 0; step_ < STEPS; step_++) {
        float a = float(step_) / float(STEPS), b = float(step_ + 1) / float(STEPS), far = reach * 0.5 * (a * a + b * b);
        place = eye_place + far * ray;
        for (int i = 0; i < heads; i++) {
            float air = exp(-exposure.z * (far + distance(place, lamp_place[i].xyz)));
            scattered += lamp_light(i, l) * (air * exposure.z * 0.0796 * reach * (b * b - a * a));
        }
    }
    gl_Position = vec4(clip, -0.999, 1.0);
}
