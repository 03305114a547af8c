using System;

// Stubs of Unity's classes to compile the package and its samples with Mono. See tests/clients/test_csharp_unity.py.
namespace UnityEngine
{
    public class Object
    {
        public string name { get; set; }

        public static void Destroy(Object what)
        {
        }
    }

    public class Component : Object
    {
        public GameObject gameObject { get; private set; }

        public Transform transform { get; private set; }

        public T GetComponent<T>()
        {
            return default(T);
        }
    }

    public class GameObject : Object
    {
    }

    public class MonoBehaviour : Component
    {
        public bool isActiveAndEnabled { get; private set; }
    }

    public class Transform : Component
    {
        public Vector3 position { get; set; }

        public Quaternion rotation { get; set; }
    }

    public class Camera : Component
    {
        public RenderTexture targetTexture { get; set; }

        public void Render()
        {
        }
    }

    public class Renderer : Component
    {
        public Material material { get; set; }
    }

    public class Material : Object
    {
        public Texture mainTexture { get; set; }
    }

    public class Texture : Object
    {
    }

    public class RenderTexture : Texture
    {
        public RenderTexture(int width, int height, int depth)
        {
        }

        public static RenderTexture active { get; set; }
    }

    public enum TextureFormat
    {
        RGB24,
    }

    public class Texture2D : Texture
    {
        public Texture2D(int width, int height)
        {
        }

        public Texture2D(int width, int height, TextureFormat format, bool mipChain)
        {
        }

        public void ReadPixels(Rect source, int x, int y)
        {
        }
    }

    public static class ImageConversion
    {
        public static byte[] EncodeToJPG(this Texture2D texture, int quality)
        {
            return new byte[0];
        }

        public static bool LoadImage(this Texture2D texture, byte[] data)
        {
            return true;
        }
    }

    public struct Rect
    {
        public Rect(float x, float y, float width, float height)
        {
        }
    }

    public struct Vector3
    {
        public float x, y, z;

        public Vector3(float x, float y, float z)
        {
            this.x = x;
            this.y = y;
            this.z = z;
        }
    }

    public struct Quaternion
    {
        public float x, y, z, w;

        public Quaternion(float x, float y, float z, float w)
        {
            this.x = x;
            this.y = y;
            this.z = z;
            this.w = w;
        }
    }

    public static class Time
    {
        public static float unscaledTime { get; set; }
    }

    public static class Debug
    {
        public static void LogException(Exception exception)
        {
        }

        public static void LogWarning(object message)
        {
        }

        public static void LogWarning(object message, Object context)
        {
        }
    }

    public static class Application
    {
        public static event Action quitting
        {
            add { }
            remove { }
        }
    }

    public enum RuntimeInitializeLoadType
    {
        SubsystemRegistration,
    }

    public sealed class RuntimeInitializeOnLoadMethodAttribute : Attribute
    {
        public RuntimeInitializeOnLoadMethodAttribute(RuntimeInitializeLoadType type)
        {
        }
    }

    public sealed class DefaultExecutionOrder : Attribute
    {
        public DefaultExecutionOrder(int order)
        {
        }
    }

    public sealed class AddComponentMenu : Attribute
    {
        public AddComponentMenu(string menu)
        {
        }
    }

    public sealed class TooltipAttribute : Attribute
    {
        public TooltipAttribute(string text)
        {
        }
    }

    public sealed class SerializeField : Attribute
    {
    }

    public sealed class RequireComponent : Attribute
    {
        public RequireComponent(Type type)
        {
        }
    }
}
