using UnityEngine;

namespace Nep.Unity
{
    /// <summary>Closes every node when the editor leaves play mode or reloads scripts, with and without domain reload.</summary>
    internal static class PlayMode
    {
        [RuntimeInitializeOnLoadMethod(RuntimeInitializeLoadType.SubsystemRegistration)]
        private static void Begin()
        {
            Node.CloseAll(); // nodes of an earlier play mode in static fields
            Application.quitting -= Node.CloseAll;
            Application.quitting += Node.CloseAll;
#if UNITY_EDITOR
            UnityEditor.AssemblyReloadEvents.beforeAssemblyReload -= Node.CloseAll;
            UnityEditor.AssemblyReloadEvents.beforeAssemblyReload += Node.CloseAll;
#endif
        }
    }
}
