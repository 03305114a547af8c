using UnityEngine;

namespace Nep.Unity
{
    /// <summary>
    /// Closes every node when the editor leaves play mode or reloads scripts, with and without domain reload, and shows the
    /// library's warnings in the console.
    /// </summary>
    internal static class PlayMode
    {
        [RuntimeInitializeOnLoadMethod(RuntimeInitializeLoadType.SubsystemRegistration)]
        private static void Begin()
        {
            Log.Sink = Debug.LogWarning;
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
