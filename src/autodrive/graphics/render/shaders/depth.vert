// Positions only, for shadow maps.
uniform mat4 clip_from_map;
in vec3 position;
#ifdef JOINTED
uniform mat4 bones[BONES];
in vec2 bone_lamp;
#endif
void main() {
#ifdef JOINTED
    gl_Position = clip_from_map * bones[int(bone_lamp.x)] * vec4(position, 1.0);
#else
    gl_Position = clip_from_map * vec4(position, 1.0);
#endif
}
