// Light of headlights that the air scatters towards the camera: a grid over the image. Along the view ray of each vertex,
// single scattering by air that scatters equally in all directions. The grid is as deep as the mean of that light, so that
// what is nearer hides it.
layout(std140) uniform Frame { FRAME_FIELDS };
uniform mat4 map_from_clip;
uniform int heads;
const ivec2 CELLS = ivec2(48, 36);
const int STEPS = 14;
out vec3 scattered;
vec3 place;
LIGHT_FORMULAS
void main() {
    ivec2 at = ivec2(gl_VertexID % (CELLS.x + 1), gl_VertexID / (CELLS.x + 1));
    vec2 clip = 2.0 * vec2(at) / vec2(CELLS) - 1.0;
    vec4 from = map_from_clip * vec4(clip, -1.0, 1.0), to = map_from_clip * vec4(clip, 1.0, 1.0);
    vec3 eye_place = from.xyz / from.w, ray = normalize(to.xyz / to.w - eye_place), l;
    float reach = ray.z < 0.0 ? min(3.0, eye_place.z / -ray.z) : 3.0;  // to the ground, else far enough
    scattered = vec3(0.0);
    float amount = 1e-6, moment = 1e-6 * reach;
    for (int step_ = 0; step_ < STEPS; step_++) {
        float a = float(step_) / float(STEPS), b = float(step_ + 1) / float(STEPS), far = reach * 0.5 * (a * a + b * b);
        place = eye_place + far * ray;
        for (int i = 0; i < heads; i++) {
            float air = exp(-exposure.z * (far + distance(place, lamp_place[i].xyz)));
            vec3 light = lamp_light(i, l) * (air * exposure.z * 0.0796 * reach * (b * b - a * a));
            scattered += light;
            amount += light.g;
            moment += light.g * far;
        }
    }
    // depth of a point at that distance along the ray; w of `from` and `to` are 1 / distance of the near and far plane
    float along = (1.0 / to.w - 1.0 / from.w) / distance(to.xyz / to.w, from.xyz / from.w);
    float depth = 1.0 / (1.0 / from.w + 0.97 * moment / amount * along);
    gl_Position = vec4(clip, 2.0 * (from.w - depth) / (from.w - to.w) - 1.0, 1.0);
}
